"""Engine of the page on a running fleet of real processes: it listens, and does what its operator's rights allow.

Faults take the way of `lfa fault`: a signal to a process of this user here, or an operator's message to all. The stop
button is `lfa stop`: every gateway latches it, and who has not stopped is named.
"""

from __future__ import annotations

from contextlib import ExitStack
from typing import Any

from lfa.deploy.client.discovery import agents
from lfa.deploy.client.mission_changes import along
from lfa.deploy.client.operator import Operator
from lfa.deploy.client.order_calls import OrderCalls
from lfa.deploy.client.session import FleetAddress, Subscriber, listen, scenario_of_fleet
from lfa.deploy.client.stop_call import StopCall
from lfa.deploy.client.stop_fleet import TOPICS as STOP_TOPICS
from lfa.deploy.client.stop_fleet import outcome_lines
from lfa.deploy.faults.goals import check_goal
from lfa.deploy.faults.link_faults import goal_of, note
from lfa.deploy.faults.script import FAULT_ACTIONS, GOAL, LEADER, ORDERS, RESTART, SIGNALS
from lfa.deploy.process.identity import identify, send_signal
from lfa.deploy.recording.simulation_time import WorldTime
from lfa.deploy.view.picture.ground import ground_of, ground_of_mission
from lfa.deploy.view.picture.picture import TOPICS, Picture
from lfa.protocol import clock, incarnations
from lfa.protocol.errors import Refused
from lfa.protocol.messages.orders import OrderNote
from lfa.protocol.messages.simulation import Truth
from lfa.protocol.messages.stop import StopState
from lfa.protocol.messages.team import Event, MissionNote
from lfa.protocol.mission import Mission
from lfa.protocol.names import robot_id_of, robot_name, whole_number
from lfa.protocol.topics import address
from lfa.protocol.transport.message_bus import send
from lfa.world.description.scenario import Point

HEARD = frozenset(f"*/{topic}" for topic in TOPICS - {"scan"}) | STOP_TOPICS
MISSION_S = 2.0
"""Time [s] within which a fleet says its mission."""
BEAT_S = 0.2
"""Period [s] at which the fleet hears that an operator is there."""
RESTART_S, RESTART_EVERY_S = 2.0, 0.3
SENT_S = 0.02
"""Delay [s] so that the event about a fault leaves before the fault."""
LINK_FAULTS = ("cut", "heal", "loss", "range")


class FleetEngine:
    """Engine of one running fleet; without processes of this user's own it can only stop it and order formations."""

    number = 1

    def __init__(self, fleet: FleetAddress) -> None:
        """Listen, and wait for the mission. Raises Refused for a fleet that says none."""
        self._fleet = fleet
        self._open = ExitStack()
        self._subscriber: Subscriber = self._open.enter_context(listen(fleet, HEARD))
        self._operator = Operator(fleet.name, incarnations.drawn())
        self._time = WorldTime()
        self._call: tuple[StopCall, bool] | None = None
        self._stopped = False
        self._restarts: dict[int, tuple[float, float]] = {}
        """Robots to restart: until when [s], and when the launcher is asked next."""
        self._beat_at = 0.0
        self._began = clock.now()
        mission = self._mission()
        scenario = self._scenario = scenario_of_fleet(fleet)
        self._ground = ground_of_mission(mission) if scenario is None else ground_of(scenario)
        self._orders = OrderCalls(self._operator, lambda envelope: send(self._subscriber.bus, envelope), mission)
        self._robots = mission.robots
        self._picture = Picture(mission.robots, late=True)

    @property
    def pictures(self) -> list[Picture]:
        return [self._picture]

    def _mission(self) -> Mission:
        send(self._subscriber.bus, self._operator.ask("mission", clock.now()))
        until = clock.now() + MISSION_S
        while clock.now() < until:
            self._subscriber.wait(0.05)
            for _, message in self._subscriber.take():
                if isinstance(message, MissionNote):
                    return message.mission
        self.close()
        raise Refused(f"fleet {self._fleet.name}: nobody says its mission within {MISSION_S:g} s, is it running?")

    def scene(self) -> dict[str, Any]:
        return {
            "engine": "fleet",
            "title": f"fleet {self._fleet.name}",
            "scenario": self._fleet.name,
            "panes": [self._ground],
            "stop": True,
            "faults": bool(self._fleet.team),
            "simulated": self._scenario is not None and bool(self._fleet.team),
        }

    def state(self) -> dict[str, Any]:
        return {"playing": True, "speed": 1, "over": "", "faults": [], "stopped": self._stopped}

    def advance(self) -> None:
        """Take in what came, say what is due, and repeat what has not been answered yet."""
        now = clock.now()
        for arrival, message in self._subscriber.take():
            where = address(arrival.key)
            if where is None:
                continue
            if isinstance(message, Truth):
                self._time.see(arrival.at, message.time_s)
            robot = robot_id_of(where.owner)
            if isinstance(message, StopState) and robot is not None and self._call is not None:
                self._call[0].hear(robot, message, now)
            if isinstance(message, OrderNote | Event):
                self._orders.hear(message)
            if where.topic in TOPICS:
                self._picture.see(self._at(arrival.at), where.owner, where.topic, message)
        self._go_on_stopping(now)
        self._go_on_restarting(now)
        self._orders.step(now)
        if now >= self._beat_at and self._call is None:
            self._beat_at = now + BEAT_S
            send(self._subscriber.bus, self._operator.stop(None, (), now))

    def _at(self, arrived: float) -> float:
        """Return the time [s] of the page: that of the world, without one since the page began to look."""
        return self._time.of(arrived) if self._time.known else arrived - self._began

    def obey(self, order: dict[str, Any]) -> dict[str, Any]:
        match order:
            case {"do": "stop" | "resume" as do}:
                self._call = StopCall(do == "stop", clock.now()), do == "stop"
                self._call[0].name(self._robots)
                self._go_on_stopping(clock.now())
                return {"said": f"{do}: said to all"}
            case {"do": "fault", "text": str(text)}:
                return {"said": self._fault(text)}
            case {"do": "scan", "robot": int() as robot, "on": bool(on)} if robot in self._robots:
                wanted = self._picture.wanted_scans
                (wanted.add if on else wanted.discard)(robot)
                self._subscriber.follow(HEARD | {f"{robot_name(one)}/scan" for one in wanted})
                return {}
        raise Refused(f"{str(order.get('do'))[:20]}: no such order for a running fleet")

    def _go_on_stopping(self, now: float) -> None:
        if self._call is None:
            return
        call, stand = self._call
        try:
            said = call.said(now)
            if said is not None:
                send(self._subscriber.bus, self._operator.stop(said.word, said.gateways, now))
            outcome = call.outcome(now)
        except Refused as refused:
            self._call = None
            self._tell(str(refused), alarm=True)
            return
        if outcome is not None:
            self._call = None
            self._stopped = stand
            self._tell("; ".join(outcome_lines(outcome, stand=stand)), alarm=not outcome.complete)

    def _go_on_restarting(self, now: float) -> None:
        for robot, (until, again) in list(self._restarts.items()):
            if self._picture.role(robot) != "gone":
                del self._restarts[robot]
            elif now > until:
                del self._restarts[robot]
                self._tell(f"restart {robot}: no lfa run is there that starts it again", alarm=True)
            elif now >= again:
                self._restarts[robot] = until, now + RESTART_EVERY_S
                send(self._subscriber.bus, self._operator.command(RESTART, now, robot=robot))

    def _tell(self, text: str, *, alarm: bool) -> None:
        """Add a line to what happens."""
        t = round(self._picture.t, 3)
        self._picture.news.add({"k": "event", "t": t, "kind": "operator", "who": None, "text": text, "alarm": alarm})

    def _fault(self, text: str) -> str:
        """Carry out a fault; return what was done. Raises Refused."""
        action, _, target = text.strip().partition(" ")
        if action not in FAULT_ACTIONS:
            raise Refused(f"{action[:20]!r}: must be one of {', '.join(FAULT_ACTIONS)}")
        if target == LEADER:
            if self._picture.leader is None:
                raise Refused(f"{text}: nobody leads at the moment")
            target = str(self._picture.leader)
        if action == GOAL:
            return self._go(goal_of(target))
        if action in ORDERS:
            return self._order(action, target)
        robot = whole_number(target)
        if robot not in self._robots or robot is None:
            raise Refused(f"{text[:60]}: must name a robot of {', '.join(map(str, self._robots))}")
        if action == RESTART:
            now = clock.now()
            self._restarts[robot] = now + RESTART_S, now
            return f"{RESTART} {robot}"
        return self._signal(action, robot)

    def _signal(self, action: str, robot: int) -> str:
        announced = False
        for team in (
            self._fleet.team,
            None,
        ):  # those found at the start, without a look through all processes; then all
            here = agents() if team is None else team
            for agent in here:
                if agent.fleet != self._fleet.name or agent.robot != robot or identify(agent.identity.pid) is None:
                    continue
                if not announced:
                    send(self._subscriber.bus, self._operator.event("fault", clock.now(), deed=action, robot=robot))
                    clock.sleep(SENT_S)
                announced = True
                if send_signal(agent.identity, SIGNALS[action]):
                    return f"{action} {robot} (process {agent.identity.pid})"
        raise Refused(f"{action} {robot}: no process of yours here is robot {robot}")

    def _go(self, goal: Point) -> str:
        """Send the team to another goal [m] as `lfa go` does, and tell what becomes of it. Raises Refused."""
        if self._scenario is not None:
            check_goal(self._scenario, goal)
        said = f"{GOAL} {goal[0]:g},{goal[1]:g}"
        walls = () if self._scenario is None else self._scenario.world.walls_m

        def tell(done: bool, text: str) -> None:
            self._tell(f"{said}: {text}", alarm=not done)

        self._orders.begin(along((goal,), walls), False, clock.now(), tell)
        return said

    def _order(self, action: str, target: str) -> str:
        team = [agent for agent in agents() if agent.fleet == self._fleet.name]
        if action != "formation" and not team:
            raise Refused(f"{action}: the processes of this fleet are not yours")
        if action in LINK_FAULTS and not all("--faults" in agent.identity.arguments for agent in team):
            raise Refused(f"{action}: the fleet's processes were started without --faults")
        now = clock.now()
        said = note(self._operator, now, action, target, self._robots)
        robot = whole_number(target)
        send(
            self._subscriber.bus,
            self._operator.event("fault", now, deed=action, robot=target if robot is None else robot),
        )
        send(self._subscriber.bus, said)
        return f"{action} {target}".strip()

    def close(self) -> None:
        """End the session with the fleet, which goes on."""
        self._open.close()
