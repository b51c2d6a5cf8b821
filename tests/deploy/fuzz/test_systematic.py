"""Systematic and guided search: every schedule has its place, and the same seed is the same schedule."""

from __future__ import annotations

from itertools import islice

import pytest
from msgspec import structs

from lfa.deploy.fuzz.fault_injector import play
from lfa.deploy.fuzz.schedules import FIRST_AT_S, LEADER, HeldMessage, ScheduledFault, draw
from lfa.deploy.fuzz.search import guided, systematic
from lfa.deploy.fuzz.search.command import command
from lfa.deploy.fuzz.search.searches import Search
from lfa.deploy.fuzz.search.trace_text import describe
from lfa.protocol.errors import Refused

FIRST_LEVELS = sum(systematic.level_size(*level) for level in systematic.LEVELS[: systematic.WHOLE])


def test_the_levels_with_one_deviation_are_searched_whole_and_each_schedule_once() -> None:
    seen = {(one.faults, one.held) for one in map(systematic.schedule, range(FIRST_LEVELS))}
    assert len(seen) == FIRST_LEVELS == 1 + 24 + 180
    assert all(len(faults) + len(held) <= 1 for faults, held in seen)


def test_a_search_that_goes_on_takes_all_other_levels_in_turn() -> None:
    cycle = len(systematic.TURNS)
    sizes = [
        (len(one.faults), len(one.held))
        for one in map(systematic.schedule, range(FIRST_LEVELS, FIRST_LEVELS + 2 * cycle))
    ]
    assert sizes == [*systematic.TURNS] * 2
    assert set(systematic.TURNS) == set(systematic.LEVELS[systematic.WHOLE :])


def test_no_schedule_has_more_than_two_faults_and_three_delays_among_three_robots() -> None:
    for number in range(0, 4000, 7):
        one = systematic.schedule(number)
        assert one.robots == 3
        assert len(one.faults) <= 2
        assert len(one.held) == len({held.number for held in one.held}) <= 3
        assert all(0 <= held.number < systematic.MESSAGES for held in one.held)


def test_the_schedules_of_a_level_are_all_different() -> None:
    level = (2, 0)
    size = systematic.level_size(*level)
    numbers = (n for n in range(FIRST_LEVELS, 40 * size) if systematic.place(n)[0] == level)
    assert len({systematic.schedule(number).faults for number in islice(numbers, size)}) == size


def test_what_is_covered_is_counted_by_level() -> None:
    lines = systematic.covered(range(FIRST_LEVELS + len(systematic.TURNS)))
    assert lines[:3] == [
        "0 faults, 0 delays: 1 of 1", "0 faults, 1 delays: 180 of 180", "1 faults, 0 delays: 24 of 24"]  # fmt: skip
    assert lines[3].startswith("1 faults, 1 delays: 4 of ")


def test_a_message_is_delayed_or_lost_by_its_number_from_the_first_fault_on() -> None:
    calm = play(systematic.schedule(0))
    late = next(n for n in range(FIRST_LEVELS) if [h.by_s for h in systematic.schedule(n).held] == [None])
    assert play(systematic.schedule(late)).simulation.now == calm.simulation.now >= FIRST_AT_S
    assert play(systematic.schedule(late)).violations == []


def test_a_guided_seed_is_the_same_schedule_whenever_its_island_is_played(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(guided, "DRAWN", 2)
    island = dict(guided.evolve(range(7), play))
    assert island[6].schedule == Search("guided").schedule(6)
    assert island[6].schedule.faults != draw(6).faults, "it is no drawn one but a changed one"
    assert not any(played.violations for played in island.values())


def test_searches_that_exclude_each_other_are_refused() -> None:
    with pytest.raises(Refused, match="must be one of the two"):
        command(is_systematic=True, is_guided=True)
    with pytest.raises(Refused, match="--whole: must go without"):
        command(is_systematic=True, whole=True)


def test_a_systematic_search_prints_how_many_schedules_of_each_level_it_covered(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert command(seeds="0..3", is_systematic=True) == 0
    assert "0 faults, 1 delays: 3 of 180" in capsys.readouterr().out


def test_l6_is_not_claimed_where_a_message_is_held_back() -> None:
    """Of candidates that stand 10 ms apart, the second wins when the first one's PREPARE comes 30 ms late."""
    late = tuple(HeldMessage(number, 0.03) for number in range(3))
    one = structs.replace(systematic.schedule(0), faults=(ScheduledFault(1.5, "kill", (LEADER,)),), held=late)
    assert not one.is_single
    assert play(one).violations == []
    assert "message" in describe(one).splitlines()[-1]
