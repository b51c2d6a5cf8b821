"""E32: pause, goal and values of a running team in virtual time, and a leader that dies right after the order."""

from __future__ import annotations

from collections.abc import Callable
from math import hypot
from pathlib import Path

import pytest
from msgspec import structs

from lfa.agents.agent import Agent
from lfa.agents.orders.team_orders import QUESTION, TeamOrders
from lfa.deploy.client.mission_changes import along, to_goal, unchanged
from lfa.deploy.client.operator import Operator
from lfa.deploy.client.order_call import Change, OrderCall, OrderOutcome
from lfa.deploy.fuzz.agent_simulation import FLEET, AgentSimulation
from lfa.deploy.fuzz.network import FAIR
from lfa.deploy.fuzz.schedules import draw
from lfa.deploy.operate import go
from lfa.deploy.operate.set import to_values
from lfa.protocol.errors import Refused
from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.orders import OrderNote
from lfa.protocol.messages.simulation import Truth
from lfa.protocol.messages.team import Event
from lfa.protocol.mission import Leading, Mission
from lfa.protocol.transport.message_bus import send

DRIVING_S = 4.0
NEAR_M = 0.3


class Commanded:
    """A team of three that drives along a straight road, and its operator."""

    def __init__(self, seed: int = 0) -> None:
        schedule = structs.replace(
            draw(seed), robots=3, profile="std", witness=True, rates={}, faults=(), spares=(), stops=(), radio=FAIR
        )
        self.team = AgentSimulation(schedule)
        self.truth: dict[int, tuple[float, float, float]] = {}
        """Of each robot x [m], y [m] and speed [m/s]."""
        self._call: OrderCall | None = None
        self.team.simulator.taps.append(self._hear)
        self.team.start_all()
        self.team.run(DRIVING_S)

    def _hear(self, _now: float, _key: str, _payload: bytes, message: Message) -> None:
        match message:
            case Truth():
                self.truth = {robot.id: (robot.x, robot.y, abs(robot.linear_x)) for robot in message.robots}
            case OrderNote() | Event() if self._call is not None:
                self._call.hear(message)

    def say(
        self,
        change: Change,
        *,
        paused: bool | None = False,
        during: Callable[[], None] = lambda: None,
        after_s: float = 0.0,
    ) -> OrderOutcome:
        """Order `change`, call `during` so long after its first word, and run until the call is over."""
        operator = Operator(FLEET, round(1000 * self.team.now))
        call = self._call = OrderCall(change, paused, self.team.now)
        call.hear_mission(self.team.mission)
        send(self.team.simulator, operator.ask(QUESTION, self.team.now))
        first_at: float | None = None
        while (outcome := call.outcome(self.team.now)) is None or first_at is None:
            order = call.said(self.team.now)
            if order is not None:
                send(self.team.simulator, operator.order(order, self.team.now))
                first_at = self.team.now if first_at is None else first_at
            if first_at is not None and self.team.now >= first_at + after_s:
                during()
                during = lambda: None  # noqa: E731
            self.team.run(self.team.now + 0.005)
        during()
        return outcome

    def run(self, for_s: float) -> Commanded:
        self.team.run(self.team.now + for_s)
        return self

    def orders_of(self, robot: int) -> TeamOrders:
        node = self.team.processes[robot].node
        assert isinstance(node, Agent) and node.core is not None
        return node.core._team_orders

    def leader(self) -> int:
        (leader,) = self.team.leaders()
        return leader

    def kill_leader(self) -> None:
        self.team.kill(self.leader())


def test_e32_a_pause_stops_the_team_and_go_ends_it() -> None:
    scene = Commanded()
    outcome = scene.say(unchanged, paused=True)
    assert (outcome.leader, outcome.version) == (1, 1)
    assert all(speed < 1e-3 for _, _, speed in scene.run(6.0).truth.values())
    assert scene.leader() == 1, "a leader that pauses is not stuck"
    assert scene.say(to_values(["cruise_mps=0.4"]), paused=None).version == 2
    assert all(speed < 1e-3 for _, _, speed in scene.run(1.0).truth.values()), "a pause outlasts other orders"
    assert scene.say(unchanged).version == 3
    assert all(speed > 0.1 for _, _, speed in scene.run(3.0).truth.values())


def test_e32_a_goal_by_hand_is_driven_to() -> None:
    scene = Commanded()
    x, y, _ = scene.truth[1]
    goal = (x + 4.0, y + 1.0)
    assert scene.say(along((goal,), ())).leader == 1
    scene.run(14.0)
    assert hypot(scene.truth[1][0] - goal[0], scene.truth[1][1] - goal[1]) < NEAR_M
    assert all(speed < 1e-2 for _, _, speed in scene.truth.values())


@pytest.mark.parametrize("after_s", [0.0, 0.02, 0.1])
def test_e32_a_leader_that_dies_right_after_the_order_leaves_it_to_the_next(after_s: float) -> None:
    scene = Commanded()
    x, y, _ = scene.truth[1]
    goal = (x + 4.0, y + 1.5)
    outcome = scene.say(along((goal,), ()), during=scene.kill_leader, after_s=after_s)
    assert outcome.leader in (1, 2)
    assert scene.run(1.0).leader() == 2
    scene.run(18.0)
    assert hypot(scene.truth[2][0] - goal[0], scene.truth[2][1] - goal[1]) < NEAR_M


def test_e32_an_acknowledged_order_is_not_lost_where_the_next_leader_has_missed_it() -> None:
    scene = Commanded()
    x, y, _ = scene.truth[1]
    goal = (x + 4.0, y + 1.5)
    with pytest.MonkeyPatch.context() as patch:  # robot 2 hears of the order neither from the operator nor the leader
        patch.setattr(scene.orders_of(2), "propose", lambda *_: False)
        patch.setattr(scene.orders_of(2), "hear", lambda *_: False)
        assert scene.say(along((goal,), ())).robots == (1, 3)
        scene.kill_leader()
    assert scene.run(1.0).leader() == 2
    scene.run(20.0)
    assert hypot(scene.truth[2][0] - goal[0], scene.truth[2][1] - goal[1]) < NEAR_M


def test_e32_a_speed_within_the_limits_holds_and_one_beyond_them_changes_nothing() -> None:
    scene = Commanded()
    assert scene.say(to_values(["cruise_mps=0.2"])).leader == 1
    assert abs(scene.run(3.0).truth[1][2] - 0.2) < 0.02
    with pytest.raises(Refused, match="cruise_mps = 9"):
        scene.say(to_values(["cruise_mps=9"]))
    assert abs(scene.run(1.0).truth[1][2] - 0.2) < 0.02


def test_e32_k_d_by_hand_moves_the_slots() -> None:
    scene = Commanded()
    assert scene.say(to_values(["separation_m=1.8", "side=column"])).leader == 1
    scene.run(25.0)
    gap_m = hypot(scene.truth[1][0] - scene.truth[2][0], scene.truth[1][1] - scene.truth[2][1])
    assert abs(gap_m - 1.8) < 0.1


@pytest.mark.parametrize(
    ("point", "reason"),
    [((1.0, 2.0), "in a wall"), ((1.0, 3.0), "outside of the map or walled off")],
)
def test_a_goal_in_or_behind_a_wall_is_refused_in_one_line(point: tuple[float, float], reason: str) -> None:
    walls = ((-200.0, 2.0, 200.0, 2.0), (-200.0, 4.0, 200.0, 4.0), (-200.0, 2.0, -200.0, 4.0), (200.0, 2.0, 200.0, 4.0))
    scene = Commanded()
    with pytest.raises(Refused, match=reason):
        scene.say(along((point,), walls))
    assert scene.run(1.0).truth[1][2] > 0.1


def test_a_goal_that_is_no_number_is_refused() -> None:
    with pytest.raises(Refused, match="must be finite"):
        to_goal(float("nan"), 1.0, None)
    with pytest.raises(Refused, match="heading inf: must be a finite number"):
        to_goal(3.0, 1.0, float("inf"))


def test_a_goal_out_of_reach_is_refused_and_one_farther_along_a_route_is_not() -> None:
    scene = Commanded()
    mission = scene.team.mission
    with pytest.raises(Refused, match=r"goal \(9999, 9999\): \d+ m from all way-points, must be at most 1000 m"):
        scene.say(along(((9999.0, 9999.0),), ()))
    assert scene.run(1.0).truth[1][2] > 0.1
    along(((900.0, 0.0), (1800.0, 0.0), (2700.0, 0.0)), ())(mission, mission)


@pytest.mark.parametrize(
    ("values", "line"),
    [
        (["cruise_mps=x"], "set cruise_mps=x: must be a number"),
        (["cruise_mps=nan"], "set cruise_mps=nan: must be a number"),
        (["cruise_mps="], "set cruise_mps=: must be a number"),
        (["side=up"], "set side=up: must be one of left, right, column, zigzag"),
        (["side=left", "formation.side=right"], "set formation.side=right: side is given twice, must be given once"),
        (["robots=3"], "set robots=3: must be key=value with one of motion, "),
    ],
)
def test_values_that_are_none_are_refused_in_one_line(values: list[str], line: str) -> None:
    with pytest.raises(Refused) as refused:
        to_values(values)
    assert str(refused.value).startswith(line)


@pytest.mark.parametrize("text", [".5", "+0.5", "5e-1", "0.5_0", "\N{ARABIC-INDIC DIGIT ZERO}.5"])
def test_a_value_is_what_python_reads_as_a_number(text: str) -> None:
    mission = Mission((1, 2, 3), leading=Leading(route_m=((1.0, 0.0),)))
    assert to_values([f"cruise_mps={text}"])(mission, mission).leading.cruise_mps == 0.5


@pytest.mark.parametrize("text", ["nan 3", "1e400 3", "3", "1 2 3", "x y"])
def test_a_route_file_names_the_line_that_is_no_way_point(tmp_path: Path, text: str) -> None:
    path = tmp_path / "route.txt"
    path.write_text(f"# x y\n1 2\n{text}\n", encoding="utf-8")
    with pytest.raises(Refused) as refused:
        go.command(route=path)
    assert str(refused.value) == f"{path}:3: {text!r}: must be a way-point x y [m]"


def _driven(scene: Commanded, for_s: float, v_mps: object, omega_radps: float) -> None:
    """Drive the leader by hand for so long, 20 times a second."""
    operator, until = Operator(FLEET, round(1000 * scene.team.now)), scene.team.now + for_s
    while scene.team.now < until:
        send(scene.team.simulator, operator.command("teleop", scene.team.now, v_mps=v_mps, omega_radps=omega_radps))
        scene.run(0.05)


def test_a_leader_driven_by_hand_brakes_when_the_keys_are_released_and_returns_to_its_route() -> None:
    scene = Commanded()
    scene.say(unchanged, paused=True)
    scene.run(2.0)
    _driven(scene, 2.0, 0.3, 0.0)
    assert abs(scene.truth[1][2] - 0.3) < 0.02, "also while the team is paused"
    scene.run(0.8)
    assert scene.truth[1][2] < 1e-3, "released"
    scene.say(unchanged)
    assert scene.run(5.0).truth[1][2] > 0.3, "its route goes on"


def test_a_twist_that_is_no_number_drives_nobody() -> None:
    scene = Commanded()
    scene.say(unchanged, paused=True)
    scene.run(2.0)
    for bad in (float("nan"), "fast", None):
        _driven(scene, 0.5, bad, 0.0)
        assert scene.truth[1][2] < 1e-3
