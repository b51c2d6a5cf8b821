"""Tricks of a schedule: the team keeps every invariant, and what each is there for is found by it alone."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from lfa.deploy.fuzz.fault_injector import play
from lfa.deploy.fuzz.schedules import Schedule, ScheduledFault, draw
from lfa.deploy.fuzz.search import systematic
from lfa.deploy.fuzz.search.searches import shrink
from lfa.deploy.fuzz.search.trace_text import describe
from tests.protocol.lease.planted import PLANTED

TRICKS = {
    "blackout": ScheduledFault(1.5, "blackout", (1, 2, 3), 0.1),
    "made_up": ScheduledFault(1.5, "made_up", (3,), value=0.0),
    "ahead": ScheduledFault(1.5, "ahead", (2,), value=1e9),
    "version": ScheduledFault(0.8, "version", (2,), 2.0),
}
BUGS = {
    "made_up": "any term is believed, also the last one",
    "ahead": "a time that is still to come is believed",
    "version": "messages of any version are read",
}


def schedule(*kinds: str) -> Schedule:
    """Three robots on perfect links, without a fault, with these tricks."""
    return replace(systematic.schedule(0), tricks=tuple(TRICKS[kind] for kind in kinds))


@pytest.mark.parametrize("kind", TRICKS)
def test_a_team_keeps_every_invariant_through_a_trick(kind: str) -> None:
    assert play(schedule(kind)).violations == []


@pytest.mark.parametrize("kind", BUGS)
def test_the_bug_that_a_trick_is_for_is_found_and_the_other_tricks_are_left_out(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    next(bug for bug in PLANTED if bug.what == BUGS[kind]).plant(monkeypatch)
    bad = schedule("blackout", kind) if kind == "version" else schedule(kind)
    name = play(bad).violations[0].name
    assert [trick.kind for trick in shrink(bad, name).tricks] == [kind]


@pytest.mark.parametrize("seed", [1039, 1073])
def test_a_made_up_term_is_not_read_by_a_process_of_another_version(seed: int) -> None:
    assert {"made_up", "version"} <= {trick.kind for trick in draw(seed).tricks}
    assert play(draw(seed)).violations == [], f"reproduce: lfa fuzz --seed {seed} -v"


def test_drawn_schedules_have_every_trick_and_say_so() -> None:
    drawn = [draw(seed) for seed in range(60)]
    assert {trick.kind for one in drawn for trick in one.tricks} == set(TRICKS)
    for one in drawn:
        assert all(trick.kind in describe(one) for trick in one.tricks)


def test_a_calm_schedule_is_often_a_pair_at_the_greatest_loss() -> None:
    calm = [one for one in map(draw, range(400)) if not one.faults]
    assert any(one.robots == 2 and not one.witness and one.radio.loss == 0.2 for one in calm)
    assert not any(one.tricks for one in calm)
