"""Routers that lose declarations: 12 robots on 5 hosts, one of which is lost and comes back (E27, L2)."""

from __future__ import annotations

import pytest

from lfa.deploy.fuzz.agent_simulation import AgentSimulation
from lfa.deploy.fuzz.schedules import FAIR, Schedule
from lfa.protocol.names import robot_name
from lfa.protocol.node import PeerDown, PeerUp, RouterLost
from lfa.protocol.transport.links import AGAIN_S, ANEW_S

HOSTS: dict[int, tuple[tuple[int, ...], ...]] = {
    12: ((1, 2, 3), (4, 5, 6), (7, 8, 9), (10, 11, 12)),
    4: ((1, 2), (3, 4)),
}
"""Who is on which host, by the number of robots; one more host has the world with the witness."""
LOST_S, FLAP_S = 3.0, 8.0
"""Times [s] for which a host is away, and its routers' links flap afterwards: longer than any delay in ANEW_S."""
JOINED_S = AGAIN_S[1] + 3.0


def _fleet(robots: int) -> AgentSimulation:
    schedule = Schedule(1, robots, True, "std", False, {}, (), FAIR, revive_all=True)
    fleet = AgentSimulation(schedule).start_all().run(4.0)
    assert _chain(fleet) == set(fleet.mission.robots)
    return fleet


def _chain(fleet: AgentSimulation) -> set[int]:
    leaders = fleet.leaders()
    assert len(leaders) == 1, f"leaders: {leaders}"
    return set(fleet.lease_of(leaders[0]).chain)


def _lose_declarations(fleet: AgentSimulation, host: tuple[int, ...]) -> None:
    """The router of `host` and the others have lost each other's declarations, and lose them for FLAP_S longer."""
    others = [robot for robot in fleet.ids if robot not in host]
    pairs = [(robot_name(here), robot_name(there)) for here in host for there in others]
    fleet.simulator.deaf |= {*pairs, *(pair[::-1] for pair in pairs)}
    fleet.simulator.loses_declarations = True
    fleet.at(fleet.now + FLAP_S, setattr, fleet.simulator, "loses_declarations", False)


@pytest.mark.parametrize("robots", [12])
def test_e27_l2_a_host_that_comes_back_joins_though_routers_lost_its_declarations(robots: int) -> None:
    """A host with the leader dies and comes back; nobody else hears it until its robots and the leader declare anew."""
    fleet = _fleet(robots)
    host = next(host for host in HOSTS[robots] if fleet.leaders()[0] in host)
    for robot in host:
        fleet.kill(robot)
    fleet.run(fleet.now + LOST_S)
    assert _chain(fleet) == set(fleet.mission.robots) - set(host)
    _lose_declarations(fleet, host)
    for robot in host:
        fleet.start(robot)
    _run_until_whole(fleet, fleet.now + FLAP_S + JOINED_S)


@pytest.mark.parametrize("robots", [12])
def test_e27_l2_robots_of_a_killed_router_join_though_the_next_router_lost_their_declarations(robots: int) -> None:
    """They go over to another router: tokens come back, but no HELLO nor PROPOSE passes."""
    fleet = _fleet(robots)
    host = next(host for host in HOSTS[robots] if fleet.leaders()[0] not in host)
    _hint(fleet, PeerDown, host)
    fleet.simulator.hint(RouterLost(), [robot_name(robot) for robot in host])
    _lose_declarations(fleet, host)
    fleet.run(fleet.now + 0.5)
    _hint(fleet, PeerUp, host)
    fleet.run(fleet.now + FLAP_S)
    assert max(ANEW_S) < FLAP_S, "the delays after an event alone would do"
    assert _chain(fleet) == set(fleet.mission.robots) - set(host)
    _run_until_whole(fleet, fleet.now + JOINED_S)


def _run_until_whole(fleet: AgentSimulation, by: float) -> None:
    """Run until all robots are in one chain, at most to `by` [s]: later, one may be left out for being stuck (E22)."""
    while _chain(fleet) != set(fleet.mission.robots):
        assert fleet.now < by, f"not in the chain: {set(fleet.mission.robots) - _chain(fleet)}"
        fleet.run(fleet.now + 0.5)


def _hint(fleet: AgentSimulation, event: type[PeerUp] | type[PeerDown], host: tuple[int, ...]) -> None:
    """Tell all others that the tokens of the robots of `host` vanished or appeared."""
    for robot in host:
        name = robot_name(robot)
        others = [other for other in fleet.simulator.names if other != name]
        fleet.simulator.hint(event(name, fleet.processes[robot].member.incarnation), others)
