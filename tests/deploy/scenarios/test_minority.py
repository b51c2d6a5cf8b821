"""L7: a side without a quorum comes to rest, in virtual time, on clocks that all keep the same time."""

from __future__ import annotations

from collections.abc import Sequence

from msgspec import structs

from lfa.deploy.fuzz.agent_simulation import AgentSimulation
from lfa.deploy.fuzz.network import FAIR
from lfa.deploy.fuzz.schedules import draw
from lfa.protocol.lease.timing import CONTROL_PERIOD_S
from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.simulation import Truth
from lfa.protocol.names import robot_id_of

CUT_S = 4.0
"""All four drive at cruising speed by then."""
END_S = 7.0
REST_MPS = 1e-6
TRUTH_S = 0.02
"""Speeds are told this often."""
HEARD_S = 0.002
"""What was on its way when the cut came still arrives."""
T_DR_S = 0.5


class Cut:
    """A team of four, of which `side` is cut off from the rest and the witness; what became of it."""

    def __init__(self, side: Sequence[int]) -> None:
        calm = structs.replace(FAIR, jitter_s=HEARD_S - FAIR.delay_s)
        schedule = structs.replace(
            draw(0), robots=4, profile="std", witness=True, rates={}, faults=(), spares=(), radio=calm
        )
        self.team = AgentSimulation(schedule).start_all()
        self.timing = self.team.timing
        self.limits = self.team.mission.limits
        self.course: dict[int, list[tuple[float, float, float]]] = {}
        """Of each robot, time [s], x [m] and speed [m/s]."""
        self.team.simulator.taps.append(self._hear)
        self.team.run(CUT_S)
        rest = [robot for robot in self.team.ids if robot not in side]
        self.team.part({pair for a in side for b in rest for pair in ((a, b), (b, a))})
        self.team.run(END_S)

    def _hear(self, now: float, _key: str, _payload: bytes, message: Message) -> None:
        if isinstance(message, Truth):
            for robot in message.robots:
                self.course.setdefault(robot.id, []).append((now, robot.x, robot.linear_x))

    def speed_mps(self, robot: int) -> float:
        """When the cut came."""
        return max(v for at, _, v in self.course[robot] if at <= CUT_S and at > CUT_S - 2.0 * TRUTH_S)

    def rest_s(self, robot: int) -> float:
        """How long after the cut it moved for the last time."""
        return max((at for at, _, v in self.course[robot] if v > REST_MPS), default=CUT_S) - CUT_S

    def way_m(self, robot: int) -> float:
        """How far it came after the cut."""
        return self.course[robot][-1][1] - next(x for at, x, _ in self.course[robot] if at >= CUT_S)

    def last_command_s(self, *robots: int) -> float:
        """How long after the cut a leader command of theirs was obeyed for the last time."""
        by = [at for at, cmd in self.team.accepted if robot_id_of(cmd.header.sender) in robots]
        return max(by, default=CUT_S) - CUT_S


def test_l7_a_leader_without_a_quorum_is_at_rest_when_its_lease_and_its_last_command_have_run_out() -> None:
    cut = Cut((1, 2))
    stop_s = cut.speed_mps(1) / cut.limits.a_max_mps2
    assert cut.speed_mps(1) > 0.1
    assert 0.0 < cut.last_command_s(1, 2) <= cut.timing.act_s + cut.timing.deadman_s
    assert cut.rest_s(1) <= cut.timing.act_s + cut.timing.deadman_s + stop_s + TRUTH_S
    assert cut.rest_s(2) < END_S - CUT_S - 0.5, "its follower has not come to rest"
    assert cut.team.leaders() == [3]


def test_l7_a_follower_that_does_not_hear_its_predecessor_brakes_and_does_not_close_up() -> None:
    cut = Cut((3, 4))
    v, a = cut.speed_mps(3), cut.limits.a_max_mps2
    braking_s = T_DR_S + HEARD_S + 2.0 * CONTROL_PERIOD_S
    assert v > 0.1
    assert T_DR_S / 2.0 < cut.rest_s(3) <= braking_s + v / a + TRUTH_S
    assert cut.way_m(3) <= v * braking_s + v * v / (2.0 * a) + v * TRUTH_S, "it has closed up"
    assert cut.last_command_s(3, 4) == 0.0
    assert cut.rest_s(4) < END_S - CUT_S - 0.5, "the one behind has not followed it to rest"
    assert cut.course[3][-1][1] - cut.course[4][-1][1] > 0.2, "the one behind has driven into it"
    assert cut.course[1][-1][2] > 0.1, "those with the witness drive on"
