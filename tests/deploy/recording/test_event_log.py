"""What the events of a run say about leaders and failovers."""

from __future__ import annotations

from typing import Any

import pytest

from lfa.deploy.recording import event_log
from lfa.deploy.recording.event_log import Failover, Line


def _line(t: float, robot: int, kind: str, term: tuple[int, int, int] | None = None, **data: Any) -> Line:
    return {"t": t, "robot": robot, "term": None if term is None else list(term), "kind": kind, **data}


FIRST, SECOND, THIRD = (2, 1, 1), (3, 2, 1), (4, 3, 1)
KILLED = [
    _line(0.3, 1, "leader_command", FIRST),
    _line(8.0, 1, "fault", deed="kill"),
    _line(8.1, 2, "chain", SECOND, chain=[2, 3]),
    _line(8.11, 2, "lease", SECOND, change="acquired"),
    _line(8.12, 2, "leader_command", SECOND),
    _line(8.15, 3, "chain", SECOND, chain=[2, 3]),
]


def test_a_reign_ends_when_its_holder_is_killed() -> None:
    first, second = event_log.leader_terms(KILLED)
    assert (first.robot_id, first.from_s, first.until_s, first.cause) == (1, 0.3, 8.0, "start")
    assert (second.robot_id, second.from_s, second.until_s, second.cause) == (2, 8.12, None, "kill")


def test_a_failover_counts_from_the_fault() -> None:
    (failover,) = event_log.failovers(KILLED, event_log.leader_terms(KILLED))
    assert failover == Failover("kill", 1, 8.0, 2, lease_ms=110.0, first_command_ms=120.0, chain_ms=150.0)


def test_a_lease_is_held_no_later_than_the_first_command_under_it() -> None:
    late = [line if line["kind"] != "lease" else {**line, "t": 8.13} for line in KILLED]
    (failover,) = event_log.failovers(sorted(late, key=lambda line: line["t"]), event_log.leader_terms(late))
    assert (failover.lease_ms, failover.first_command_ms) == (120.0, 120.0)


def _killed_unannounced(*more: Line, kind: str = "peer_down") -> list[Line]:
    vanished = _line(8.0, 1, kind, name="robot1", incarnation=5)
    return sorted([line for line in KILLED if line["kind"] != "fault"] + [vanished, *more], key=lambda line: line["t"])


@pytest.mark.parametrize("kind", ["peer_down", "died"])
def test_a_leader_that_dies_without_an_announced_fault_is_a_failover(kind: str) -> None:
    events = _killed_unannounced(kind=kind)
    (failover,) = event_log.failovers(events, event_log.leader_terms(events))
    assert failover == Failover("died", 1, 8.0, 2, lease_ms=110.0, first_command_ms=120.0, chain_ms=150.0)


@pytest.mark.parametrize(
    "more",
    [
        _line(8.05, 1, "peer_up", name="robot1", incarnation=5),  # its token returned: a router died
        _line(7.9, 1, "lease", FIRST, change="released"),  # it left in order
        _line(7.9, None, "over"),  # type: ignore[arg-type]  # the run stopped
    ],
)
def test_a_vanished_token_that_is_no_death_is_no_failover(more: Line) -> None:
    events = _killed_unannounced(more)
    assert event_log.failovers(events, event_log.leader_terms(events)) == []


def test_a_chain_that_not_all_have_closed_is_not_closed() -> None:
    (failover,) = event_log.failovers(KILLED[:-1], event_log.leader_terms(KILLED[:-1]))
    assert failover.chain_ms is None


def test_a_failover_that_never_came_is_told_as_such() -> None:
    (failover,) = event_log.failovers(KILLED[:2], event_log.leader_terms(KILLED[:2]))
    assert (failover.leader, failover.first_command_ms) == (None, None)


def test_a_fault_on_a_follower_is_no_failover() -> None:
    events = [KILLED[0], _line(5.0, 3, "fault", deed="kill")]
    assert event_log.failovers(events, event_log.leader_terms(events)) == []


def test_a_hand_over_is_no_failover() -> None:
    events = [KILLED[0], _line(6.0, 2, "leader_command", SECOND)]
    leader_terms = event_log.leader_terms(events)
    assert [led.cause for led in leader_terms] == ["start", "handover"]
    assert leader_terms[0].until_s == 6.0
    assert event_log.failovers(events, leader_terms) == []


def test_a_lease_that_ran_out_is_named_as_the_cause() -> None:
    expired = _line(5.9, 1, "lease", FIRST, change="expired")
    events = [KILLED[0], expired, _line(6.0, 2, "leader_command", SECOND)]
    assert event_log.leader_terms(events)[1].cause == "expired"


def test_the_same_robot_elected_again_is_no_hand_over() -> None:
    events = [KILLED[0], _line(6.0, 1, "leader_command", (3, 1, 1))]
    assert [led.cause for led in event_log.leader_terms(events)] == ["start", "reelection"]


def test_I2_an_older_leader_command_after_a_newer_one_is_a_violation() -> None:
    events = [_line(1.0, 1, "leader_command", SECOND), _line(1.1, 2, "leader_command", FIRST)]
    (violation,) = event_log.terms_that_went_back(events)
    assert (violation.invariant, violation.at_s) == ("I2", 1.1)
    assert event_log.terms_that_went_back(KILLED) == []


def test_the_last_chain_is_the_newest_configs() -> None:
    late = [_line(9.0, 3, "chain", SECOND, chain=[2, 3, 1], seq=1), _line(9.1, 2, "chain", SECOND, chain=[2, 3], seq=0)]
    assert event_log.last_chain([*KILLED, *late]) == [2, 3, 1]
    assert event_log.last_chain([]) == []


def test_what_becomes_of_the_chain_when_all_are_told_to_stop_is_not_the_runs() -> None:
    stopping = [_line(9.0, 0, "over"), _line(9.01, 2, "chain", SECOND, chain=[2], seq=1)]
    assert event_log.last_chain([*KILLED, *stopping]) == [2, 3]
