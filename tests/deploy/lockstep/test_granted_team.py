"""Agents that execute grants: the run is that of `lfa sim`, call by call."""

from __future__ import annotations

from pathlib import Path
from signal import SIGKILL

import pytest
from msgspec.structs import replace

from lfa.deploy.faults.script import parse_all
from lfa.deploy.lockstep.diff_command import compare
from lfa.deploy.run import simulate
from lfa.protocol.errors import Refused
from lfa.protocol.messages.grants import CallResult, GrantAnswer, GrantedCall, TimeGrant
from lfa.protocol.runtime.granted_time import GrantedNode
from lfa.protocol.runtime.state_hashes import HASHES
from lfa.protocol.transport.link_model import Radio
from lfa.world.description.load import Scenario, draw, load
from tests.rigs.granted_agents import GrantedAgents, granted_run

SEED = 7
FAULTS = ("stop 2 at 1 s for 0.4 s", "kill leader at 2 s", "restart 1 at 2.5 s", "terminate 4 at 3 s")
UNTIL_S = 4.0
USUAL = Radio()


def _scenario(radio: Radio = USUAL) -> Scenario:
    return draw(replace(load("straight"), radio=radio), SEED)


def _simulated(drawn: Scenario, folder: Path, faults: tuple[str, ...] = ()) -> Path:
    (folder / "journal").mkdir(parents=True)
    parsed = parse_all(drawn.mission, drawn.faults, faults)
    run = simulate.SimulatedRun(drawn, SEED, parsed, lambda *_: None, folder / "journal")
    run.advance(UNTIL_S)
    run.close()
    return folder


def _granted(drawn: Scenario, folder: Path, agents: GrantedAgents, faults: tuple[str, ...] = ()) -> Path:
    (folder / "journal").mkdir(parents=True)
    run = granted_run(drawn, SEED, folder, agents, fault=faults)
    run.advance(UNTIL_S)
    run.close()
    return folder


@pytest.mark.parametrize(
    "radio",
    [USUAL, Radio(delay_s=0.0, jitter_s=0.002), Radio(loss=0.2, duplication=0.1, duplication_lag_s=0.01)],
    ids=["usual", "no shortest delay", "loss and duplicates"],
)
def test_granted_agents_make_the_run_of_the_simulation(tmp_path: Path, radio: Radio) -> None:
    drawn = _scenario(radio)
    simulated = _simulated(drawn, tmp_path / "simulated", FAULTS)
    granted = _granted(drawn, tmp_path / "granted", GrantedAgents(), FAULTS)
    assert (granted / HASHES).read_text() == (simulated / HASHES).read_text(), compare(granted, simulated)
    for journal in (simulated / "journal").iterdir():
        assert (granted / "journal" / journal.name).read_bytes() == journal.read_bytes(), journal.name


def test_a_process_that_ends_counts_as_killed_and_changes_nothing_before(tmp_path: Path) -> None:
    drawn, agents = _scenario(), GrantedAgents()

    def end_at_two_seconds(name: str, grant: TimeGrant) -> None:
        if name == "robot2" and grant.calls and grant.calls[-1].at >= 2.0:
            agents.signal(name, SIGKILL)

    agents.on_grant = end_at_two_seconds
    granted = _granted(drawn, tmp_path / "granted", agents)
    found = compare(granted, _simulated(drawn, tmp_path / "simulated"))
    assert found.time_s == pytest.approx(2.02, abs=0.021)
    assert "robot2" in found.first


def test_most_calls_are_granted_together(tmp_path: Path) -> None:
    """Sensors and poses wait for the next tick of their receiver, and robots that are due together compute together."""
    agents = GrantedAgents()
    calls: list[int] = []
    agents.on_grant = lambda name, grant: calls.append(len(grant.calls))
    _granted(_scenario(), tmp_path / "granted", agents)
    assert sum(calls) > 2 * len(calls), f"{sum(calls)} calls in {len(calls)} grants"


def test_a_node_stops_where_a_call_moved_its_deadline_before_the_next() -> None:
    class Reminded:
        name, incarnation, started_with = "robot1", 1, {}
        interests: frozenset[str] = frozenset()
        finished, refusal, deadline = False, None, 10.0

        def next_deadline(self) -> float:
            return self.deadline

        def receive(self, received: object) -> list[object]:
            return []

        def tick(self, now: float) -> list[object]:
            self.deadline = now + 0.001
            return []

    node = GrantedNode(Reminded())  # type: ignore[arg-type]
    answer = node.answer(TimeGrant(1, (GrantedCall(1.0), GrantedCall(1.0005), GrantedCall(1.002))))
    assert answer == GrantAnswer(1, (CallResult([], 1.001),))


def test_a_topic_that_wakes_nobody_and_is_answered_at_once_is_refused(tmp_path: Path) -> None:
    agents = GrantedAgents()
    right = agents.answer_of

    def hasty(name: str, grant: TimeGrant) -> GrantAnswer:
        answer = right(name, grant)
        first = answer.results[0]
        if grant.calls[0].key.endswith("/sensors"):
            first = replace(first, sent=[("lfa/sim/robot1/event", b"")])
        return GrantAnswer(answer.number, (first, *answer.results[1:]))

    agents.answer_of = hasty  # type: ignore[method-assign]
    with pytest.raises(Refused, match="answers a message on sensors at once"):
        _granted(_scenario(), tmp_path / "granted", agents)
