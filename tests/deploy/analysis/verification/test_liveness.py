"""The checkers of what holds after the last fault notice what is broken, and nothing else."""

from __future__ import annotations

from lfa.deploy.analysis.verification.liveness import CHANGE_HEARTBEATS, OneVersion
from lfa.protocol.lease.timing import timing_of
from lfa.protocol.messages.consensus import Config, Member, Term, Version

STD = timing_of("std")
TEAM = (Member(1, 1), Member(2, 1))
HEALED_S, OVER_S = 4.0, 8.0


def config(seq: int) -> Config:
    return Config(Version(Term(1, 1, 1), seq), TEAM, None, None, TEAM)


def told(*adoptions: tuple[float, int]) -> OneVersion:
    """Both hold version 0 when the faults end; then robot 1, and after it robot 2, by turns adopt the next."""
    checker = OneVersion(STD)
    for who in TEAM:
        checker.lives(0.0, who)
        checker.adopts(0.0, who, config(0))
    checker.heals(HEALED_S, 0.0)
    for n, (at, seq) in enumerate(adoptions):
        checker.adopts(at, TEAM[n % 2], config(seq))
    checker.over(OVER_S)
    return checker


def test_l3_a_version_that_one_never_hears_of_is_a_violation() -> None:
    assert told((5.0, 1)).violations


def test_l3_versions_that_differ_until_late_are_a_violation_though_they_become_equal() -> None:
    assert told((5.0, 1), (7.5, 1)).violations


def test_l3_a_late_change_on_its_way_at_the_end_is_none() -> None:
    assert not told((OVER_S - 0.5 * CHANGE_HEARTBEATS * STD.heartbeat_s, 1)).violations


def test_l3_late_changes_that_reach_everybody_at_once_are_none() -> None:
    assert not told((7.0, 1), (7.05, 1), (7.1, 2), (7.15, 2)).violations
