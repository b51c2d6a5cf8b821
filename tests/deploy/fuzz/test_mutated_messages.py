"""Messages of valid form with mutated fields, said to whole agents: none crashes one, and nothing gets unsafe."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from copy import deepcopy
from random import Random
from typing import Any

import msgspec
import pytest

from lfa.deploy.analysis.verification.safety import SAFETY
from lfa.deploy.fuzz.agent_simulation import AgentSimulation
from lfa.deploy.fuzz.network import FAIR
from lfa.deploy.fuzz.schedules import Schedule
from lfa.protocol.geometry import Twist
from lfa.protocol.lease.gateway import Gateway
from lfa.protocol.messages.codec import Message
from lfa.protocol.mission import Limits
from lfa.protocol.topics import TOPIC, address, message_in

CALM_S, ATTACKED_S, GAP_S = 2.0, 4.0, 0.005
HEADER, SEQ = 1, 2
"""Place of the header in a message, behind its tag, and of the sequence number in that."""
KEPT = 600
"""Number of messages kept to choose from; the oldest half is dropped."""
VALUES: tuple[Any, ...] = (
    math.nan, math.inf, -math.inf, 1e308, -1e308, 1e-320, 0, -0.0, -1, 2**53, 2**63 - 1, -(2**63),
    "", None, True, [], {}, [0.0] * 5000, "\x1b[31m<script>",
)  # fmt: skip


def _places(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Yield the path of every part of a decoded message."""
    if path:
        yield path
    parts = enumerate(value) if isinstance(value, list) else value.items() if isinstance(value, dict) else ()
    for name, part in parts:
        yield from _places(part, (*path, name))


def _other(old: Any, random: Random) -> Any:
    """Return a value in the place of `old`: near it, far from it, or of another kind."""
    number = isinstance(old, int | float) and not isinstance(old, bool)
    if number and random.random() < 0.5:
        new = random.choice((-old, old * 1e6, old + 1, old - 1, old * 1e-9, old + 1e3))
        return int(new) if isinstance(old, int) and math.isfinite(new) else new
    if isinstance(old, list) and random.random() < 0.5:
        return random.choice((old[:-1], old + old, old[::-1], old[:1]))
    return deepcopy(random.choice(VALUES))  # a later mutation may change it


def _mutated(payload: bytes, random: Random) -> bytes:
    message = msgspec.msgpack.decode(payload)
    message[HEADER][SEQ] += 1  # else it would be dropped as heard before
    for _ in range(random.choice((1, 1, 2, 4))):
        *way, last = random.choice(list(_places(message)))
        part = message
        for name in way:
            part = part[name]
        part[last] = _other(part[last], random)
    try:
        return msgspec.msgpack.encode(message)
    except (OverflowError, ValueError):  # a number too great for the format
        return payload


class Liar:
    """Says what members have said again on their own keys, with mutated fields: as one with their keys could."""

    def __init__(self, team: AgentSimulation, random: Random, spared: frozenset[str]) -> None:
        self.accepted = Counter[str]()
        """Number of mutated messages of valid form said, by topic."""
        self.refused = 0
        self._team, self._random, self._spared = team, random, spared
        self._heard: list[tuple[str, str, bytes]] = []
        team.simulator.taps.append(self._hear)
        team.at(team.now, self._lie)

    def _hear(self, _now: float, key: str, payload: bytes, _message: Message) -> None:
        where = address(key)
        if where is not None and where.topic not in self._spared:
            self._heard.append((where.topic, key, payload))
            if len(self._heard) > KEPT:
                del self._heard[: KEPT // 2]

    def _lie(self) -> None:
        self._team.at(self._team.now + GAP_S, self._lie)
        if not self._heard:
            return
        topic = self._random.choice(sorted({topic for topic, _, _ in self._heard}))
        there = [one for one in self._heard if one[0] == topic]
        # The newest half of the time: a command is obeyed only while its stamp is young.
        _, key, payload = there[-1] if self._random.random() < 0.5 else self._random.choice(there)
        lie = _mutated(payload, self._random)
        if message_in(key, lie) is None:
            self.refused += 1
        else:
            self.accepted[topic] += 1
            self._team.simulator.publish(key, lie)


def _attacked(seed: int, spared: frozenset[str]) -> tuple[AgentSimulation, Liar, list[str]]:
    """Run a team under attack; return also the invariants that fell."""
    team = AgentSimulation(Schedule(seed, 3, True, "std", False, {}, (), FAIR, revive_all=True))
    checkers = [checker(team.timing) for checker in SAFETY]
    team.listen(checkers)
    team.start_all().run(CALM_S)
    liar = Liar(team, Random(seed), spared)
    team.run(CALM_S + ATTACKED_S)
    return team, liar, [str(violation) for checker in checkers for violation in checker.violations]


REPRODUCE = ".venv/bin/pytest tests/deploy/fuzz/test_mutated_messages.py"
GROUND_TRUTH = frozenset({"truth", "clock", "mission"})
"""What no robot's keys say, and no robot hears; a mission is agreed on (E25)."""
LEASES = frozenset({"lease", "cmd_vel", "sensors"})
"""Votes and commands of a robot, and its gateway's word: whoever says these in the names of all has a quorum."""


ALL_BUT_COMMANDS = frozenset(TOPIC) - {"cmd_vel"}


@pytest.mark.parametrize("spared", [GROUND_TRUTH, ALL_BUT_COMMANDS], ids=["all", "commands"])
@pytest.mark.parametrize("seed", [1, 2])
def test_no_mutated_message_crashes_a_robot_or_gets_through_a_gateway_beyond_its_limits(
    seed: int, spared: frozenset[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    let_through: list[Twist] = []
    ordinary = Gateway.twist

    def twist(gateway: Gateway, now: float) -> Twist:
        let_through.append(ordinary(gateway, now))
        return let_through[-1]

    monkeypatch.setattr(Gateway, "twist", twist)
    team, liar, _ = _attacked(seed, spared)
    limits = team.mission.limits
    assert sum(liar.accepted.values()) > 20 and liar.refused > 20, (liar.accepted, REPRODUCE)
    assert let_through and all(_within(limits, one) for one in let_through), REPRODUCE


def _within(limits: Limits, twist: Twist) -> bool:
    fine = math.isfinite(twist.linear_x) and abs(twist.angular_z) <= limits.omega_max_radps
    return fine and -limits.v_reverse_max_mps <= twist.linear_x <= limits.v_max_mps


@pytest.mark.parametrize("seed", [4, 5, 6])
def test_mutated_messages_about_anything_but_leases_break_no_invariant_of_them(seed: int) -> None:
    team, liar, fallen = _attacked(seed, GROUND_TRUTH | LEASES)
    assert sum(liar.accepted.values()) > 20, (liar.accepted, REPRODUCE)
    assert fallen == [], REPRODUCE
    assert len(team.leaders()) <= 1
