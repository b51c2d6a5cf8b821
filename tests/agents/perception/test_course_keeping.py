"""What turns again and again is told from what keeps its course, turns once, or stops for a while."""

from __future__ import annotations

from math import cos, pi, sin
from random import Random

import pytest

from lfa.agents.perception.obstacle_tracker import STEPS_MIN, turns_often
from lfa.agents.perception.scan import Point

ERROR_M = 0.01
"""Standard deviation [m] of a measured place."""


def measured(velocities: list[Point], chance: Random, begins_s: float = 0.0) -> list[tuple[float, Point]]:
    """Return times and places of one that changes its velocity each second, seen once a second from `begins_s` on."""
    seen = []
    for n in range(len(velocities)):
        now = n + begins_s
        whole, part = int(now), now - int(now)
        x = sum(vx for vx, _ in velocities[:whole]) + part * velocities[whole][0]
        y = sum(vy for _, vy in velocities[:whole]) + part * velocities[whole][1]
        seen.append((now, (chance.gauss(x, ERROR_M), chance.gauss(y, ERROR_M))))
    return seen


def any_direction(chance: Random, mps: float) -> list[Point]:
    return [(mps * cos(a), mps * sin(a)) for a in (2.0 * pi * chance.random() for _ in range(200))]


@pytest.mark.parametrize("begins_s", [0.0, 0.5])
@pytest.mark.parametrize("mps", [0.2, 0.4])
def test_what_takes_another_direction_each_second_turns_often(mps: float, begins_s: float) -> None:
    """Nearly always, by its last seven places: by chance it goes straight on for a while."""
    chance = Random(7)
    seen, before, told = measured(any_direction(chance, mps), chance, begins_s), False, 0
    for n in range(7, len(seen)):
        before = turns_often(seen[n - 7 : n], before=before)
        told += before
    assert told > 0.9 * len(seen)


def test_what_turned_again_and_again_and_now_goes_straight_on_keeps_its_course() -> None:
    chance = Random(3)
    assert not turns_often(measured([(0.3, 0.0)] * 7, chance), before=True)


@pytest.mark.parametrize(
    "velocities",
    [
        [(0.3, 0.0)] * 7,
        [(0.3, 0.0)] * 3 + [(-0.3, 0.0)] * 4,
        [(0.0, 0.3)] * 3 + [(0.0, 0.0)] * 4,
        [(0.3 * cos(0.3 * n), 0.3 * sin(0.3 * n)) for n in range(7)],
        [(0.01, 0.0)] * 7,
    ],
    ids=["straight on", "turns round once", "stops", "on a bend", "hardly moves"],
)
def test_what_keeps_its_course_but_for_a_while_does_not_turn_often(velocities: list[Point]) -> None:
    chance = Random(3)
    assert not any(turns_often(measured(velocities, chance)) for _ in range(20))


def test_after_a_few_steps_nothing_is_known_to_turn_often() -> None:
    to_and_fro = [(0.4, 0.0), (-0.4, 0.0)] * 4
    assert not turns_often(measured(to_and_fro[:STEPS_MIN], Random(1)))
    assert turns_often(measured(to_and_fro[: STEPS_MIN + 1], Random(1)))
