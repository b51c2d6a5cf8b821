"""Agents of a lockstep run in this process: they execute grants as their processes do, without processes and links."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from pathlib import Path
from signal import Signals
from typing import Any, cast

from lfa.agents.agent import Agent
from lfa.deploy.faults.script import parse_all
from lfa.deploy.lockstep.team import GrantedTeam
from lfa.deploy.process.process_group import ProcessSpec
from lfa.deploy.run.simulate import FLEET, SimulatedRun
from lfa.protocol.messages.grants import GrantAnswer, TimeGrant
from lfa.protocol.runtime.granted_time import GrantedNode
from lfa.world.description.load import Scenario


class GrantedAgents:
    """Hub and process group in one, for a `GrantedTeam`."""

    def __init__(self) -> None:
        self._agents: dict[str, GrantedNode] = {}
        self._answers: deque[tuple[str, int, GrantAnswer]] = deque()
        self._ended: set[str] = set()
        self.grants = 0
        self.on_grant: Callable[[str, TimeGrant], None] = lambda name, grant: None

    def start(self, row: ProcessSpec) -> None:
        words = row.arguments
        robot, incarnation = int(words[words.index("--id") + 1]), int(words[words.index("--lockstep") + 1])
        node = GrantedNode(Agent(robot, incarnation, FLEET, incarnation, spare="--spare" in words))
        self._agents[row.name] = node
        self._ended.discard(row.name)
        self._answers.append((row.name, incarnation, node.hello()))

    def grant(self, name: str, incarnation: int, grant: TimeGrant) -> None:
        self.grants += 1
        self.on_grant(name, grant)
        if name not in self._ended and grant.calls:
            self._answers.append((name, incarnation, self.answer_of(name, grant)))

    def answer_of(self, name: str, grant: TimeGrant) -> GrantAnswer:
        return self._agents[name].answer(grant)

    def receive(self) -> tuple[str, int, GrantAnswer] | None:
        return self._answers.popleft() if self._answers else None

    def exit_of(self, name: str) -> str | None:
        return f"{name} ended (SIGKILL)" if name in self._ended else None

    def runs(self, name: str) -> bool:
        return name not in self._ended

    def signal(self, name: str, _number: Signals) -> bool:
        self._ended.add(name)
        return True


def granted_run(
    drawn: Scenario, seed: int, folder: Path, agents: GrantedAgents, *, fault: tuple[str, ...] = ()
) -> SimulatedRun:
    """Return a run of `drawn` whose agents execute grants; its journals and state hashes are in `folder`."""

    def spec(robot_id: int, incarnation: int, spare: bool) -> ProcessSpec:
        words = ("--id", str(robot_id), "--lockstep", str(incarnation), *(("--spare",) if spare else ()))
        return ProcessSpec(f"robot{robot_id}", words)

    team = GrantedTeam(cast(Any, agents), cast(Any, agents), spec, lambda: False)
    team.start((robot, robot not in drawn.mission.robots) for robot in drawn.robots)
    faults = parse_all(drawn.mission, drawn.faults, fault)
    journals = folder / "journal"
    run = SimulatedRun(drawn, seed, faults, lambda *_: None, journals, make_agent=team.agent, make_host=team.host)
    team.upcoming, team.lost = run.upcoming, run.lose
    return run
