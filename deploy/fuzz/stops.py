"""Operators who stop and resume the team of a fuzz schedule, of leases alone or of complete agents.

Its messages have a random generator of their own: a schedule of the leases is the same with and without stops. Words
come late, twice, or again long after; operators sit at a host, and share its cuts.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from random import Random
from typing import Any, Protocol

from lfa.deploy.analysis.verification.checker import Arguments, Checker
from lfa.deploy.client.stop_call import StopCall, StopOutcome
from lfa.deploy.fuzz.gateways import RunningGateway
from lfa.deploy.fuzz.partition import place
from lfa.deploy.fuzz.schedules import ScheduledFault
from lfa.protocol.errors import Refused
from lfa.protocol.fleet_stop.memory import ASK_S, StopMemory
from lfa.protocol.geometry import STILL
from lfa.protocol.lease.timing import Timing
from lfa.protocol.messages.consensus import Member
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.robot import CmdVel
from lfa.protocol.messages.stop import NO_STOP, StopKnowledge, StopOrder, StopState, StopWord
from lfa.protocol.topics import OPERATOR_NAME
from lfa.protocol.transport.link_model import LinkModel
from lfa.world.virtual_time import LocalClock

STEP_S = 0.01
LOCAL_S = 0.0003
WATCH_S = 0.25
"""Time [s] between two orders without a word of an operator who watches."""


class AskingAgent(Protocol):
    """Process of a robot's agent that may have to ask the others what holds (E30)."""

    @property
    def id(self) -> int: ...

    @property
    def member(self) -> Member: ...

    @property
    def stop(self) -> StopMemory: ...

    @property
    def clock(self) -> LocalClock: ...

    @property
    def alive(self) -> bool: ...

    @property
    def paused(self) -> bool: ...


class AskingTeam(Protocol):
    """Simulation with the newest process of each robot's agent."""

    @property
    def now(self) -> float: ...

    @property
    def processes(self) -> Mapping[int, AskingAgent]: ...

    def at(self, time: float, what: Callable[..., None], *arguments: Any) -> None: ...

    def report(self, fact: Callable[[Checker, *Arguments], None], *arguments: *Arguments) -> None: ...


class StoppedTeam(Protocol):
    """Simulation whose team operators stop: its time, its links, and the two that keep a robot's word."""

    timing: Timing
    link_model: LinkModel

    @property
    def now(self) -> float: ...

    def at(self, time: float, what: Callable[..., None], *arguments: Any) -> None: ...

    def report(self, fact: Callable[[Checker, *Arguments], None], *arguments: *Arguments) -> None: ...

    def host_of_gateway(self, robot_id: int) -> int: ...

    def gateway_now(self, robot_id: int) -> RunningGateway | None:
        """Return the gateway of a robot; None while it is down."""

    def stop_known(self, robot_id: int) -> StopKnowledge | None:
        """Return what the agent of a robot knows of the fleet stop; None while it does not run."""

    def tell_stop(self, robot_id: int, order: StopOrder) -> None:
        """Deliver an order to the agent of a robot, if it runs."""


class StopLinks:
    """Links of the simulation as the words of the fleet stop cross them, by a random generator of their own."""

    def __init__(self, team: StoppedTeam, random: Random) -> None:
        self._team = team
        self._link_model = LinkModel(team.link_model.radio, random)

    def delays(self, here: int, there: int) -> list[float]:
        """Return the delay [s] of each copy of a word from host to host."""
        if here == there:
            return [LOCAL_S]
        self._link_model.radio, self._link_model.cuts = self._team.link_model.radio, self._team.link_model.cuts
        return self._link_model.delays(place(here), place(there))


class StopTraffic:
    """Stops of one simulation; `begin` schedules them."""

    def __init__(self, team: StoppedTeam, robots: tuple[int, ...], seed: int) -> None:
        self._team = team
        self._robots = robots
        self._random = Random(f"stops-{seed}")
        self.links = StopLinks(team, self._random)
        self._said: list[StopOrder] = []
        self._acknowledged: dict[int, StopWord] = {}
        """Greatest stop that each robot's gateway has acknowledged, as kept by its agent too."""
        self._relying: set[int] = set()
        """Robots whose agent and gateway have forgotten, while more than half of the agents know: they ask (E30)."""
        self._answers = 0
        self.outcomes: list[tuple[float, float, StopOutcome]] = []
        """Results of the calls that have ended, with the times [s] of their begin and end."""

    @property
    def observer(self) -> Checker:
        """Observer of the simulation, to be told of its facts as a checker is."""
        return _Observer(self._team.timing, self)

    def begin(self, calls: tuple[ScheduledFault, ...]) -> None:
        """Schedule the calls of operators, and the replays of their words."""
        for number, call in enumerate(calls, start=1):
            if call.kind == "replay":
                self._team.at(call.at, self._replay, call.targets[0])
            elif call.kind == "watch":
                self._team.at(call.at, self._watch, call.targets[0], number, 1, call.at + call.duration_s)
            else:
                self._team.at(call.at, self._call, call.kind == "stop", call.targets[0], number)

    # --- operators ---------------------------------------------------------------------------------------------

    def _call(self, stand: bool, host: int, number: int) -> None:
        call = StopCall(stand, self._team.now)
        call.name(self._robots)
        self._step(call, host, number, 1, self._team.now)

    def _step(self, call: StopCall, host: int, number: int, seq: int, begun: float) -> None:
        now = self._team.now
        try:
            said = call.said(now)
        except Refused:
            return
        if said is not None:
            order = StopOrder(Header(OPERATOR_NAME, number, seq, now), said.word, said.gateways)
            if said.word is not None and not said.word.stand:
                self._team.report(Checker.resume_said, now, said.word)
            self._say(order, host, call)
        outcome = call.outcome(now)
        if outcome is None:
            self._team.at(now + STEP_S, self._step, call, host, number, seq + 1, begun)
        else:
            self.outcomes.append((begun, now, outcome))

    def _watch(self, host: int, number: int, seq: int, until: float) -> None:
        """Show that an operator is there, until true time `until` [s], as `lfa watch` does."""
        now = self._team.now
        self._say(StopOrder(Header(OPERATOR_NAME, number, seq, now), None), host, None)
        if now + WATCH_S <= until:
            self._team.at(now + WATCH_S, self._watch, host, number, seq + 1, until)

    def _say(self, order: StopOrder, host: int, call: StopCall | None) -> None:
        self._said.append(order)
        for robot in self._robots:
            self._send(order, robot, host, call)

    def _send(self, order: StopOrder, robot: int, host: int, call: StopCall | None) -> None:
        for delay_s in self.links.delays(host, self._team.host_of_gateway(robot)):
            self._team.at(self._team.now + delay_s, self._at_gateway, order, robot, host, call)
        for delay_s in self.links.delays(host, robot):
            self._team.at(self._team.now + delay_s, self._team.tell_stop, robot, order)

    def _replay(self, robot: int) -> None:
        """Deliver each word of before once more to one robot, in any order."""
        words = {order.word: order for order in self._said}
        for order in self._random.sample(list(words.values()), len(words)):
            self._send(order, robot, robot, None)

    # --- gateways and processes --------------------------------------------------------------------------------

    def _at_gateway(self, order: StopOrder, robot: int, host: int, call: StopCall | None) -> None:
        running = self._team.gateway_now(robot)
        if running is None:
            return
        gateway, local = running
        gateway.stop.order(order, local)
        self._team.report(Checker.hears_order, self._team.now, robot, gateway.incarnation, order)
        self._answers += 1
        header = Header(f"driver{robot}", gateway.incarnation, self._answers, local)
        state = StopState(header, gateway.stop.known, gateway.twist(local) == STILL, gateway.stop.kept)
        if state.known.word.stand and state.kept:
            self._acknowledged[robot] = max(self._acknowledged.get(robot, NO_STOP), state.known.word)
            self._team.report(Checker.stop_acknowledged, self._team.now, robot, state.known.word)
        if call is not None:
            for delay_s in self.links.delays(self._team.host_of_gateway(robot), host):
                self._team.at(self._team.now + delay_s, self._answered, call, robot, state)
        self.check_wheels(robot)

    def _answered(self, call: StopCall, robot: int, state: StopState) -> None:
        call.hear(robot, state, self._team.now)

    def check_wheels(self, robot: int) -> None:
        """Report it if the wheels of a robot turn, after its gateway has obeyed a command or an order."""
        running = self._team.gateway_now(robot)
        if running is not None and running.gateway.twist(running.local_s) != STILL:
            self._team.report(Checker.turns, self._team.now, robot, running.gateway.stop.known.word)

    def gateway_started(self, robot: int) -> None:
        """Report that a robot has forgotten what it acknowledged: its agent does not know it either."""
        if self._has_forgotten(robot):
            self._forgets(robot)

    def agent_started(self, robot: int) -> None:
        """Report what is forgotten now that the agent of `robot` begins anew.

        While more than half of the agents remember for it, it is held to its word, as long as none of them starts anew.
        """
        for other in self._relying - {robot}:
            self._forgets(other)
        if not self._has_forgotten(robot):
            return
        if self._most_know(self._acknowledged[robot]):
            self._relying.add(robot)
        else:
            self._forgets(robot)

    def _has_forgotten(self, robot: int) -> bool:
        """Return True if neither agent nor gateway of a robot knows the stop that it has acknowledged."""
        word = self._acknowledged.get(robot)
        agent, running = self._team.stop_known(robot), self._team.gateway_now(robot)
        if word is None or (agent is not None and agent.word >= word):
            return False
        known = None if running is None else running.gateway.stop.known
        return not (known is not None and known.certain and known.word >= word)

    def _forgets(self, robot: int) -> None:
        self._acknowledged.pop(robot, None)
        self._relying.discard(robot)
        self._team.report(Checker.stop_forgotten, self._team.now, robot)

    def _most_know(self, word: StopWord) -> bool:
        agents = (self._team.stop_known(robot) for robot in self._robots)
        knowing = sum(one is not None and one.word >= word for one in agents)
        return 2 * knowing > len(self._robots)


class _Observer(Checker):
    """Observer that tells a `StopTraffic` of obeyed commands and of starts."""

    def __init__(self, timing: Timing, traffic: StopTraffic) -> None:
        super().__init__(timing)
        self._traffic = traffic

    def obeys(self, at: float, robot_id: int, cmd: CmdVel, age: float) -> None:
        self._traffic.check_wheels(robot_id)

    def gateway_starts(self, at: float, robot_id: int, shut_until: float) -> None:
        self._traffic.gateway_started(robot_id)

    def lives(self, at: float, who: Member) -> None:
        self._traffic.agent_started(who.id)


class StopQuestions:
    """Questions of processes that do not know enough of the fleet stop (E30); complete agents ask by themselves."""

    def __init__(self, team: AskingTeam, robots: tuple[int, ...], links: StopLinks) -> None:
        self._team = team
        self._robots = robots
        self._links = links
        team.at(0.0, self._ask_all)

    def _ask_all(self) -> None:
        self._team.at(self._team.now + ASK_S / 2.0, self._ask_all)
        for process in list(self._team.processes.values()):
            if process.id in self._robots and process.alive and not process.paused:
                self._ask(process)

    def _ask(self, process: AskingAgent) -> None:
        """Let the agent of `process` ask the others, if it is due (E30)."""
        if not process.stop.ask_due(process.clock.local(self._team.now)):
            return
        for other in self._robots:
            for delay_s in self._links.delays(process.id, other) if other != process.id else ():
                self._team.at(self._team.now + delay_s, self._asked, process.member, other)

    def _asked(self, asker: Member, robot: int) -> None:
        process = self._team.processes.get(robot)
        if process is not None and process.alive and not process.paused:
            for delay_s in self._links.delays(robot, asker.id):
                self._team.at(self._team.now + delay_s, self._learn, asker, robot, process.stop.known)

    def _learn(self, asker: Member, robot: int, known: StopKnowledge) -> None:
        process = self._team.processes[asker.id]
        if process.member == asker and process.alive and not process.paused:
            process.stop.hear_agent(robot, known)
            self._team.report(Checker.told_of_stop, self._team.now, asker, robot)
