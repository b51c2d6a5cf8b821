"""Execution of a run's faults, those of its schedule and those by hand (`lfa fault`), on its processes and links."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from random import Random

from lfa.deploy.client.mission_changes import Walls, along
from lfa.deploy.client.operator import Operator
from lfa.deploy.client.order_calls import OrderCalls
from lfa.deploy.faults.link_faults import goal_of, note
from lfa.deploy.faults.script import GOAL, ORDERS, RESTART, SIGNALS, Fault, FaultAction, FaultSchedule
from lfa.deploy.recording.simulation_time import WorldTime
from lfa.deploy.run.restarted_processes import RestartedProcesses
from lfa.protocol import clock
from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.orders import OrderNote
from lfa.protocol.messages.team import Event, OperatorNote
from lfa.protocol.mission import Mission
from lfa.protocol.names import robot_name
from lfa.protocol.node import Envelope
from lfa.protocol.topics import OPERATOR_NAME
from lfa.protocol.transport.link_model import CLEAR, LINK_CONDITIONS, LinkModel

REPEAT_S = 2.0
"""Duration [s] for which the link conditions are repeated after a restart."""


class FaultExecution:
    """Faults of one run: what is due, what was done, and which ends of processes are therefore expected."""

    def __init__(
        self,
        mission: Mission,
        walls: Walls,
        faults: Sequence[Fault],
        processes: RestartedProcesses,
        time: WorldTime,
        operator: Operator,
        publish: Callable[[Envelope], None],
    ) -> None:
        self._mission = mission
        self._walls = walls
        self._schedule = FaultSchedule(faults)
        self._processes = processes
        self._time = time
        self._operator = operator
        self._publish = publish
        self._orders = OrderCalls(operator, publish, mission)
        self._undone: list[str] = []
        self._links = LinkModel(CLEAR, Random(0))
        """Link conditions as last ordered, by the script or by hand; they are repeated to a process that restarts."""
        self._repeat_until = 0.0
        self.doomed: set[str] = set()
        """Names of processes whose end is a fault and no failure."""

    @property
    def pending(self) -> list[Fault]:
        return self._schedule.pending

    @property
    def left(self) -> tuple[str, ...]:
        """Faults that could not be executed, or are still due."""
        return (*self._undone, *map(str, self._schedule.pending))

    def hear(self, message: Message) -> None:
        """Take in an operator's message: a fault by hand, link conditions, or the order to restart a robot."""
        if isinstance(message, OrderNote | Event):
            self._orders.hear(message)
        match message:
            case Event(kind="fault", data={"robot": robot, "deed": "kill" | "terminate"}):
                if message.header.sender == OPERATOR_NAME and robot in self._mission.robots:
                    self.doomed.add(robot_name(robot))
            case OperatorNote(command=command, arguments=arguments) if command == LINK_CONDITIONS:
                self._links.obey(arguments)
            case OperatorNote(command=command, arguments={"robot": robot}) if command == RESTART:
                if robot in self._mission.robots and self._time.known:
                    self._do(RESTART, robot)

    def do_due(self, leader: int | None, tell: Callable[[str], None]) -> None:
        """Execute the faults that are due; `tell` gets a line about each that could be executed."""
        if not self._time.known:
            return
        for action, target in self._schedule.due(self._time.of(clock.now()), leader):
            if self._do(action, target):
                tell(f"fault: {action} {f'robot {target}' if isinstance(target, int) else target}")
            else:
                self._undone.append(f"{action} {target}")
        self._orders.step(clock.now())
        if self._repeat_until > clock.now() and (self._links.cuts or self._links.radio != CLEAR):
            self._publish(self._operator.command(LINK_CONDITIONS, clock.now(), **self._links.orders))

    def repeat_links(self) -> None:
        """Repeat the link conditions for a while, for a process that has just been restarted."""
        self._repeat_until = clock.now() + REPEAT_S

    def _do(self, action: FaultAction, target: int | str) -> bool:
        """Execute a fault action; return False if its process is not running, or for a restart already running."""
        name = robot_name(target) if isinstance(target, int) else target
        if action not in ORDERS and self._processes.group.runs(name) == (action == RESTART):
            return False
        self._publish(
            self._operator.event("fault", clock.now(), deed=action, robot=target, t=self._time.of(clock.now()))
        )
        if action == GOAL:
            self._orders.begin(along((goal_of(str(target)),), self._walls), False, clock.now(), self._answered)
            return True
        if action in ORDERS:
            self._publish(note(self._operator, clock.now(), action, target, self._mission.robots))
            return True
        if action == RESTART:
            self.doomed.discard(name)
            self._processes.start_again(name)
            self.repeat_links()
            return True
        if action in ("kill", "terminate"):
            self.doomed.add(name)
        return self._processes.group.signal(name, SIGNALS[action])

    def _answered(self, done: bool, text: str) -> None:
        if not done:
            self._publish(self._operator.event("order_refused", clock.now(), reason=text))
