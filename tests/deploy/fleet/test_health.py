"""Health is progress: poses that flow and one chain of all, not pids."""

from __future__ import annotations

from lfa.deploy.fleet.health import Health
from lfa.protocol.geometry import Pose2D, Twist
from lfa.protocol.messages.consensus import Role, Term
from lfa.protocol.messages.fleet import HostStatus, ProcessReport
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.team import Event, PoseStamped, Tracking

TERM = Term(7, 1, 1)


def _host(name: str = "a", state: str = "running", ended: str = "", began_ms: int = 0) -> HostStatus:
    report = ProcessReport("robot1", state, 5, 1, began_ms, 1.0, ended)
    return HostStatus(Header(f"host-{name}", 1, 1, 0.0), name, "0", "r", (0, 0), (report,))


def _pose(robot: int, role: Role, term: Term = TERM) -> PoseStamped:
    return PoseStamped(Header(f"robot{robot}", 1, 1, 0.0), 0.0, 0.0, 0.0, 0.0, Twist(0.0, 0.0), 0.0, role, term)


def _tracking(robot: int, ahead: int) -> Tracking:
    header = Header(f"robot{robot}", 1, 1, 0.0)
    return Tracking(header, ahead, 1.0, 0.0, 0.0, 0.0, Pose2D(0.0, 0.0, 0.0), 0.0, False, "keep")


def _ended(name: str) -> ProcessReport:
    return ProcessReport(name, "ended", 0, 1, 0, 1.0, f"{name} ended")


def _told(spares: list[int], retired: list[int], accepted: bool = True) -> Event:
    """Return the leader's answer on who is in the team."""
    team = {"robots": [1, 2, 3], "spares": [[one, 0] for one in spares], "retired": retired}
    return Event(Header("robot1", 1, 2, 0.0), "roster", TERM, {**team, "chain": [1], "accepted": accepted})


def _whole(at: float = 0.0) -> Health:
    health = Health((1, 2, 3), ("a",))
    health.see(at, _host())
    for robot in (1, 2, 3):
        health.see(at, _pose(robot, Role.LEADER if robot == 1 else Role.FOLLOWER))
    health.see(at, _tracking(2, 1))
    health.see(at, _tracking(3, 2))
    return health


def test_one_chain_of_all_is_healthy() -> None:
    health = _whole()
    assert health.missing(0.5) == []
    assert health.chain(0.5) == (1, 2, 3)


def test_old_poses_are_no_progress() -> None:
    assert _whole().missing(1.5)[0].startswith("robot1: no pose")


def test_a_robot_outside_the_chain_is_missing() -> None:
    health = _whole()
    health.see(0.1, _tracking(3, 9))
    assert health.missing(0.5) == ["robot3: not in the chain"]


def test_poses_of_a_namesake_elsewhere_are_not_those_of_the_fleets_robot() -> None:
    health = _whole()
    health.see(0.1, _host(began_ms=2))
    health.see(0.2, _pose(1, Role.LEADER))
    assert health.missing(0.5)[0] == "robot1: no pose of its own: another process speaks in its name, end that one"


def test_two_terms_are_no_agreement() -> None:
    health = _whole()
    health.see(0.1, _pose(3, Role.FOLLOWER, Term(6, 1, 1)))
    assert health.missing(0.5) == ["not all are in one term"]


def test_without_a_leader_nothing_is_healthy() -> None:
    health = _whole()
    health.see(0.1, _pose(1, Role.WAITING))
    assert health.missing(0.5) == ["nobody leads"]


def test_a_silent_host_is_named() -> None:
    health = Health((1,), ("a", "b"))
    health.see(0.0, _host())
    health.see(0.0, _pose(1, Role.LEADER))
    assert health.missing(0.5) == ["host b: nothing is heard of it"]


def test_what_is_given_up_will_not_come() -> None:
    health = _whole()
    health.see(0.2, _host(state="refused", ended="robot1 ended (exit code 2): lfa-agent: robot1 already runs"))
    assert health.lost() == ["host a: robot1 ended (exit code 2): lfa-agent: robot1 already runs"]


def test_a_robot_that_ended_may_have_retired_until_a_leader_tells_who_has() -> None:
    for health, told in ((Health((1,), ("a",)), False), (Health((1,), ("a",), starts=True), True)):
        health.see(0.2, _host(state="refused", ended="robot1 ended"))
        assert bool(health.lost(0.2)) == told, "in a fleet that starts nobody has retired"
        assert health.lost(2.1) == ["host a: robot1 ended"]


def test_e34_a_retired_robot_is_missed_by_nobody_and_may_end() -> None:
    health = _whole()
    health.see(0.1, _tracking(2, 9))
    health.see(0.1, _tracking(3, 1))
    health.see(0.2, _told([], [2]))
    assert (health.missing(0.5), health.chain(0.5)) == ([], (1, 3))
    health.see(0.3, HostStatus(Header("host-a", 1, 1, 0.0), "a", "0", "r", (0, 0), (_ended("robot2"),)))
    assert health.lost() == []
    health.see(0.4, HostStatus(Header("host-a", 1, 1, 0.0), "a", "0", "r", (0, 0), (_ended("robot3"),)))
    assert health.lost() == ["host a: robot3 ended"]


def test_e33_a_spare_that_has_joined_is_missing_until_it_is_in_the_chain() -> None:
    health = _whole()
    health.see(0.1, _told([7], []))
    assert health.missing(0.5) == ["robot7: no pose"]


def test_e33_a_team_that_no_quorum_has_accepted_is_not_waited_for() -> None:
    health = _whole()
    health.see(0.1, _told([7], [], accepted=False))
    assert (health.missing(0.5), health.team_told) == ([], False)
