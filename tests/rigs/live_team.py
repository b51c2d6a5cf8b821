"""Team of real processes shared by the tests of one file; all four robots are in one chain before and after each."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from lfa.deploy.analysis.verification.journals import obeyed
from lfa.deploy.bench.harness.team import Team, endless
from lfa.deploy.bench.harness.team_history import REST_MPS
from lfa.protocol import clock
from lfa.protocol.lease.timing import timing_for
from lfa.protocol.messages.consensus import Term
from lfa.protocol.messages.team import Event
from lfa.protocol.names import robot_name
from lfa.protocol.runtime import journal
from lfa.protocol.topics import address

ROBOTS = 4
WHOLE_S = 30.0
"""Maximum time [s] until all robots are in one chain again, on a machine that may be busy."""


@contextmanager
def team() -> Iterator[Team]:
    with Team(endless(ROBOTS)) as live:
        live.await_chain(ROBOTS, WHOLE_S)
        yield live


def leads(live: Team, since: float) -> list[int]:
    """Return the robots whose leader commands gateways accepted after `since` [s], without repetitions."""
    robots = [e.data["robot"] for e in _commands(live) if e.header.stamp >= since]
    return [robot for n, robot in enumerate(robots) if n == 0 or robots[n - 1] != robot]


def check_terms(live: Team) -> None:
    """Assert I2 from outside, by what the team's gateways have told."""
    check_terms_in(live.heard.events)


def check_terms_in(events: Sequence[Event]) -> None:
    """Assert I2 from outside: over all gateways, accepted leader commands never return to an older term."""
    newest = Term()
    for event in _commands_in(events):
        assert event.term is not None and event.term >= newest, (
            f"robot {event.data['robot']} was obeyed as leader of {event.term} after {newest}"
        )
        newest = event.term


def _commands(live: Team) -> list[Event]:
    return _commands_in(live.heard.events)


def _commands_in(events: Sequence[Event]) -> list[Event]:
    return sorted((e for e in events if e.kind == "leader_command"), key=lambda e: e.header.stamp)


def pass_time(live: Team, for_s: float) -> None:
    until = clock.now() + for_s
    live.wait_until(lambda: clock.now() >= until, "the clock stands", for_s + WHOLE_S)


# --- L7: a side without a quorum comes to rest ---------------------------------------------------------------------

T_DR_S = 0.5
LATE_S = 0.3
"""Tolerance [s] for a busy machine that moves bodies late; the bounds themselves are checked in virtual time."""


def last_heard(live: Team, robot: int, topic: str, senders: Sequence[str]) -> float:
    """Return the time [s] of the robot's last message of `senders` on `topic`, from its newest journal."""
    lives = (live.folder / "run" / "journal").glob(f"{robot_name(robot)}-*.bin")
    _, entries = journal.read(max(lives))
    places = ((entry.at, address(entry.key)) for entry in entries if entry.key)
    return max(at for at, where in places if where is not None and where.topic == topic and where.owner in senders)


def check_minority(live: Team, side: Sequence[int], others: Sequence[int], led: bool) -> None:
    """Assert L7 for `side`, in chain order, without a quorum: its first robot rests in time after its last message.

    With `led` the first robot is the leader; otherwise its predecessor is the last of `others`.
    """
    timing = timing_for(live.scenario.mission)
    stop_s = live.scenario.mission.limits.v_max_mps / live.scenario.mission.limits.a_max_mps2
    first = side[0]
    if led:
        voters = [robot_name(robot) for robot in (*others, 0)]
        until = last_heard(live, first, "lease", voters) + timing.act_s + timing.deadman_s
        commands = [at for at, cmd in obeyed(live.folder / "run") if cmd.as_leader and cmd.holder in side]
        assert max(commands) <= until, f"robot {first} was obeyed {max(commands) - until:.3f} s too long"
    else:
        until = last_heard(live, first, "pose", [robot_name(others[-1])]) + T_DR_S
    slowed_s = sum(e.data["stood_still_s"] for e in live.heard.events if e.kind == "slowed")
    late_s = live.heard.moved_at.get(first, until) - until - stop_s - slowed_s
    assert late_s <= LATE_S, f"robot {first} came to rest {late_s:.3f} s too late"
    live.wait_until(
        lambda: all(live.heard.speeds_mps[robot] <= REST_MPS for robot in side), "no rest behind it", WHOLE_S
    )
