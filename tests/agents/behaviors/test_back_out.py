"""A robot that backs out of a place stands no longer before what bars its way back than a stated time."""

from __future__ import annotations

from msgspec import structs

from lfa.agents.avoidance.decision import Action
from lfa.agents.avoidance.detour import Detour
from lfa.agents.avoidance.safety import SKIN_M
from lfa.agents.behaviors.back_out import STANDS_S, STANDS_S_MAX, BackOut
from lfa.agents.following.factory import follower_of
from lfa.agents.perception.obstacle_model import TRAP_M, ObstacleModel
from lfa.agents.recovery.stuck_detector import StuckMonitor
from lfa.agents.team_state import TeamState
from lfa.protocol.geometry import STILL, Pose2D, Twist
from lfa.protocol.mission import Mission

MISSION = Mission(robots=(1, 2))
BEHIND = [(-0.18, 0.05 * n) for n in range(-6, 7)] + [(-0.1, 0.18), (-0.1, -0.18), (0.0, 0.19), (0.0, -0.19)]
"""Points in `base_link` that leave no way back, whichever way the rear turns."""
AHEAD = Twist(0.3, 0.0)
HERE = Pose2D(2.0)


class Stuck:
    """A follower that came 2 m straight on, and backs out since `now`."""

    def __init__(self) -> None:
        self.monitor, self.now, self.came_m = StuckMonitor(), 0.0, 0.0
        detour, team = Detour(MISSION.radius_m, MISSION.limits), TeamState()
        model = ObstacleModel(MISSION.radius_m, MISSION.limits, team.obstacles)
        self.out = BackOut(MISSION, follower_of(MISSION), detour, model, self.monitor)
        self.model = model
        for n in range(21):
            self.out.keep(Pose2D(0.1 * n), self.now)
        self.begin()

    def begin(self) -> None:
        while self.monitor.reason is None:
            self.monitor.watch(HERE, STILL, Action.BLOCKED, None, self.now, leads=False)
            self.now += 0.1
        self.out.begin(HERE)

    def stands_s(self) -> float:
        """How long it stands until it does what its role wants again."""
        began = self.now
        while self.out.step(BEHIND, HERE, AHEAD, STILL, self.now) == STILL:
            self.now += 0.1
            assert self.now - began < 2.0 * STANDS_S_MAX
        return self.now - began


def test_it_follows_again_after_a_time_in_which_its_way_back_stays_barred() -> None:
    stuck = Stuck()
    assert abs(stuck.stands_s() - STANDS_S) < 0.2
    assert (stuck.out.under_way, stuck.monitor.reason) == (False, None)


def test_the_place_that_it_could_not_leave_is_not_barred_to_it() -> None:
    stuck = Stuck()
    stuck.stands_s()
    assert stuck.model.points(HERE) == []


def test_each_time_in_one_place_it_stands_twice_as_long_up_to_a_maximum() -> None:
    stuck, stood = Stuck(), []
    for _ in range(5):
        stood.append(round(stuck.stands_s()))
        stuck.begin()
    assert stood == [10, 20, 40, 80, 80]


def test_a_trap_that_reaches_to_the_robot_is_blocked_once_it_stands_clear_of_it() -> None:
    """Another robot got stuck beside this one, which still has to come out of the same place."""
    stuck = Stuck()
    stuck.out.bar((HERE.x + TRAP_M, HERE.y))
    stuck.out.keep(HERE, stuck.now)
    assert stuck.model.points(HERE) == []
    clear = Pose2D(HERE.x - MISSION.radius_m - SKIN_M - 0.01)
    stuck.out.keep(clear, stuck.now)
    assert stuck.model.points(clear) != []


def test_a_robot_that_counts_as_out_for_want_of_a_trail_is_not_enclosed_in_its_own_trap() -> None:
    stuck = Stuck()
    while stuck.out.under_way:  # moved along its trail to its beginning, which lies within the trap
        stuck.out.step([], Pose2D(0.3), AHEAD, STILL, stuck.now)
    stuck.out.keep(Pose2D(HERE.x - 0.5), stuck.now)
    assert stuck.model.points(HERE) == []


def test_a_large_robot_backs_out_until_it_stands_clear_of_what_it_blocks() -> None:
    large, monitor, team = structs.replace(MISSION, radius_m=1.5), StuckMonitor(), TeamState()
    model = ObstacleModel(large.radius_m, large.limits, team.obstacles)
    out = BackOut(large, follower_of(large), Detour(large.radius_m, large.limits), model, monitor)
    x, now = 0.0, 0.0
    while x < 4.0:
        x, now = x + 0.1, now + 0.1
        out.keep(Pose2D(x), now)
        monitor.watch(Pose2D(4.0), STILL, Action.BLOCKED, None, now, leads=False)
    out.begin(Pose2D(x))
    while out.under_way:
        out.step([], Pose2D(x), AHEAD, STILL, now)
        x, now = x - 0.02, now + 0.1
    out.keep(Pose2D(x), now)
    assert model.points(Pose2D(x)) != []


def test_a_trap_into_which_a_planned_way_has_led_encloses_the_robot_no_more() -> None:
    stuck, trap = Stuck(), (HERE.x + 2.0, 0.0)
    stuck.out.bar(trap)
    for x in (HERE.x, trap[0] - 0.1):
        stuck.out.keep(Pose2D(x), stuck.now)
    assert stuck.model.points(Pose2D(trap[0])) == []
    stuck.out.keep(HERE, stuck.now)
    assert stuck.model.points(Pose2D(trap[0])) != []


def test_a_trap_is_no_floor_and_counts_only_for_who_asks_for_traps() -> None:
    stuck, trap = Stuck(), (HERE.x + 1.5, 0.0)
    stuck.out.bar(trap)
    stuck.out.keep(HERE, stuck.now)
    assert stuck.model.points(HERE) != []
    assert stuck.model.points(HERE, traps=False) == []
