"""A fleet of one world and four machines with twelve robots, brought up over ssh; then some are killed."""

from __future__ import annotations

import json
from collections.abc import Iterator
from itertools import pairwise

import pytest
from msgspec.structs import replace

from lfa.deploy.bench.harness.team import endless
from lfa.deploy.client.session import FleetAddress, listen
from lfa.deploy.client.stop_call import StopOutcome
from lfa.deploy.client.stop_fleet import TOPICS, outcome_lines, stop_fleet
from lfa.deploy.recording.run_folder import toml
from lfa.protocol import clock
from lfa.protocol.messages.team import Event
from lfa.protocol.names import robot_id_of, robot_name
from tests.hosts.conftest import Figure
from tests.rigs.host_observer import Onlooker, onlooker
from tests.rigs.machines import OPERATOR, Machines, machines, why_not

WHY_NOT = why_not()
pytestmark = [pytest.mark.hosts, pytest.mark.skipif(WHY_NOT is not None, reason=str(WHY_NOT))]

ROBOTS = tuple(range(1, 13))
WORLD = "a"
CONTROL_HZ = 20.0
"""Control rate [Hz]: five machines and twelve robots share the two cores of one, which carries less at 50 Hz."""
UP_S, DOWN_S = 20.0, 5.0
START_S_MAX = 150.0
"""Limit [s] for the fleet to become healthy: a busy machine takes longer than the bar, which is told apart from it."""
FAILED_OVER_S, UNTOUCHED_S = 0.5, 0.3
DRIVES_ON_S = 3.0
STOPPED_S = 1.0
PATIENCE_S = 30.0
WATCH_S = 3.0


@pytest.fixture(scope="module")
def fleet() -> Iterator[Machines]:
    with machines(5) as made:
        course = endless(len(ROBOTS))
        course = replace(course, mission=replace(course.mission, control_hz=CONTROL_HZ))
        (made.folder / "endless.toml").write_text(toml(course))
        made.write('scenario = "endless.toml"', tail='[robots]\nspread = ["b", "c", "d", "e"]')
        yield made
        made.lfa("down", str(made.fleet_file))


@pytest.fixture(scope="module")
def up(fleet: Machines) -> tuple[Machines, float]:
    """The fleet, and how long `lfa up` took to say that all is well."""
    done = fleet.lfa("up", str(fleet.fleet_file), "--json", "--wait", f"{START_S_MAX:g}", timeout_s=START_S_MAX + 60.0)
    assert done.returncode == 0, done.stderr
    facts = json.loads(done.stdout)
    assert sorted(facts["chain"]) == list(ROBOTS)
    return fleet, facts["took_s"]


@pytest.fixture(scope="module")
def joined(up: tuple[Machines, float]) -> dict[int, str]:
    """At whose router each robot is."""
    return {robot: name for name in up[0].names for robot in up[0].part(name).robots}


def _robots_on(machines: Machines, name: str) -> set[int]:
    return set(machines.part(name).robots)


def _quiet(look: Onlooker) -> float:
    """All are there: the longest silence of any robot while nothing is done to anybody."""
    look.wait(lambda: look.whole(set(ROBOTS)), "not whole", PATIENCE_S)
    look.begin()
    look.watch(WATCH_S)
    alone = max(look.gaps().values())
    look.begin()
    return alone


def test_up_ends_with_all_robots_in_one_chain(up: tuple[Machines, float], figure: Figure) -> None:
    figure("lfa up: 1 world, 4 hosts, 12 robots, until all are healthy", up[1], UP_S)


def test_any_machine_tells_what_runs_everywhere(up: tuple[Machines, float]) -> None:
    fleet = up[0]
    told = []
    for name in (WORLD, "c"):
        done = fleet.lfa("ps", "--json", "--fleet", "convoy", "--connect", fleet.part(name).socket, on=fleet.host(name))
        assert done.returncode == 0, done.stdout + done.stderr
        told.append({(row["host"], row["process"]) for row in json.loads(done.stdout)["processes"]})
    expected = {(n, "router") for n in fleet.names} | {(WORLD, "world")}
    expected |= {(n, f"robot{r}") for n in fleet.names for r in _robots_on(fleet, n)}
    assert told == [expected, expected]


def _stopped(fleet: Machines, name: str) -> tuple[StopOutcome, float]:
    """Say stop at that machine's router; return the outcome, and the time [s] that it took."""
    part = fleet.part(name)
    with listen(FleetAddress(part.fleet, part.socket, ()), TOPICS) as operator:
        began = clock.now()
        return stop_fleet(operator, stand=True), clock.now() - began


def _resume(fleet: Machines, look: Onlooker) -> None:
    """Once all are in one chain, say stop again and then resume; all must do as told."""
    look.wait(lambda: look.whole(set(ROBOTS)), "not whole again", PATIENCE_S)
    part = fleet.part(WORLD)
    with listen(FleetAddress(part.fleet, part.socket, ()), TOPICS) as operator:
        for stand in (True, False):
            outcome = stop_fleet(operator, stand=stand)
            assert outcome.complete, outcome_lines(outcome, stand=stand)


@pytest.mark.parametrize("percent", [0, pytest.param(20, marks=pytest.mark.long), 60])
def test_e28_a_stop_reaches_all_robots_of_four_machines_or_names_them_whatever_is_lost(
    up: tuple[Machines, float], figure: Figure, percent: int
) -> None:
    """Packets between all machines are lost; the gateways are with the world, the word is said at another machine."""
    fleet = up[0]
    with onlooker(fleet, WORLD, ROBOTS) as look:
        look.wait(lambda: look.whole(set(ROBOTS)), "not whole", PATIENCE_S)
        fleet.net.lose(percent)
        outcome, took_s = _stopped(fleet, "c")
        fleet.net.heal()
        _resume(fleet, look)
    named = f"{len(outcome.silent) + len(outcome.moving)} named"
    figure(f"lfa stop, 12 robots on 4 hosts, {percent} % loss: all stopped, or {named}", took_s, STOPPED_S)
    assert sorted((*outcome.done, *outcome.silent, *outcome.moving)) == list(ROBOTS)
    assert percent > 0 or outcome.complete


def test_e28_a_stop_reaches_every_gateway_while_the_leaders_machine_is_cut_off(
    up: tuple[Machines, float], figure: Figure
) -> None:
    fleet = up[0]
    with onlooker(fleet, WORLD, ROBOTS) as look:
        look.wait(lambda: look.whole(set(ROBOTS)), "not whole", PATIENCE_S)
        name = next(n for n in fleet.names if look.chain()[0] in _robots_on(fleet, n))
        fleet.net.unplug(fleet.host(name))
        outcome, took_s = _stopped(fleet, next(n for n in "bc" if n != name))
        fleet.net.plug_in(fleet.host(name))
        _resume(fleet, look)
    figure("lfa stop, the leader's host cut off: all stopped", took_s, STOPPED_S)
    assert outcome.done == ROBOTS


def _forget_the_others(fleet: Machines, name: str) -> None:
    """Wait until the router of that machine knows of no robot's life but those of its own."""
    part, own = fleet.part(name), {robot_name(robot) for robot in _robots_on(fleet, name)}
    until = clock.now() + PATIENCE_S
    with listen(FleetAddress(part.fleet, part.socket, ()), frozenset()) as there:
        while clock.now() < until:
            there.take()
            living = {one for one in there.living if robot_id_of(one)}
            if living == own:
                return
            there.wait(0.05)
    raise AssertionError(f"the router of {name} still knows of {sorted(living - own)}")


def test_e28_a_stop_on_a_machine_that_is_cut_off_names_every_robot(up: tuple[Machines, float], figure: Figure) -> None:
    """Its own agents know the team; no life of another robot is known there any more."""
    fleet = up[0]
    with onlooker(fleet, WORLD, ROBOTS) as look:
        look.wait(lambda: look.whole(set(ROBOTS)), "not whole", PATIENCE_S)
        fleet.net.unplug(fleet.host("c"))
        _forget_the_others(fleet, "c")
        outcome, took_s = _stopped(fleet, "c")
        fleet.net.plug_in(fleet.host("c"))
        _resume(fleet, look)
    figure("lfa stop, said on a host that is cut off: all named", took_s, STOPPED_S)
    assert (outcome.silent, outcome.done) == (ROBOTS, ())


def test_when_the_operators_machine_is_cut_off_no_robot_notices(up: tuple[Machines, float], figure: Figure) -> None:
    fleet = up[0]
    with onlooker(fleet, WORLD, ROBOTS) as look:
        alone = _quiet(look)
        fleet.net.unplug(OPERATOR)
        look.watch(WATCH_S)
        gaps = look.gaps()
        fleet.net.plug_in(OPERATOR)
    figure("operator's machine cut off: the longest silence of any robot", max(gaps.values()), UNTOUCHED_S, alone)


def test_a_machine_with_the_leader_dies_and_comes_back_at_the_tail(up: tuple[Machines, float], figure: Figure) -> None:
    fleet = up[0]
    with onlooker(fleet, WORLD, ROBOTS) as look:
        look.wait(lambda: look.whole(set(ROBOTS)), "not whole", PATIENCE_S)
        name = next(n for n in fleet.names if look.chain()[0] in _robots_on(fleet, n))
        lost = _robots_on(fleet, name)
        left = set(ROBOTS) - lost
        look.begin()
        fleet.net.unplug(fleet.host(name))
        at = fleet.kill(name)
        look.wait(lambda: look.whole(left), f"robots {sorted(left)} do not drive on", PATIENCE_S)
        drives_on_s = clock.now() - at
        fleet.net.plug_in(fleet.host(name))
        done = fleet.lfa("up", str(fleet.fleet_file))
        assert done.returncode == 0, done.stderr
        look.wait(lambda: look.whole(set(ROBOTS)), "not whole again", PATIENCE_S)
        ahead = _who_joined_ahead_of_others(look.events, lost)
    figure("host of the leader dead: the chain without its robots", drives_on_s, DRIVES_ON_S)
    assert ahead == []


def _who_joined_ahead_of_others(events: list[Event], newcomers: set[int]) -> list[tuple[int, ...]]:
    """Chains in which one of `newcomers`, not in the chain before, stands ahead of somebody who was."""
    said = {(event.term, event.data["seq"], tuple(event.data["chain"])) for event in events if event.kind == "chain"}
    chains = [chain for _, _, chain in sorted(said)]
    wrong = []
    for before, chain in pairwise(chains):
        joined = [chain.index(robot) for robot in newcomers & set(chain) - set(before)]
        stayed = [chain.index(robot) for robot in before if robot in chain]
        if joined and stayed and min(joined) < max(stayed):
            wrong.append(chain)
    return wrong


@pytest.mark.parametrize("name", ["b", *(pytest.param(other, marks=pytest.mark.long) for other in "acde")])
def test_a_killed_router_costs_its_own_robots_little_and_the_others_nothing(
    up: tuple[Machines, float], joined: dict[int, str], figure: Figure, name: str
) -> None:
    """They go over to the next machine's router, and stay there."""
    fleet = up[0]
    own = {robot for robot, at in joined.items() if at == name}
    following = fleet.names[(fleet.names.index(name) + 1) % len(fleet.names)]
    with onlooker(fleet, "c" if name == "b" else "b", ROBOTS) as look:
        alone = _quiet(look)
        fleet.kill_router(name)
        look.watch(WATCH_S)
        gaps = look.gaps()
        look.wait(lambda: look.whole(set(ROBOTS)), "not whole again", PATIENCE_S)
    joined.update(dict.fromkeys(own, following))
    if own:
        figure(f"router {name} killed: longest silence of its robots", max(gaps[r] for r in own), FAILED_OVER_S, alone)
    others = max((gaps[r] for r in ROBOTS if r not in own), default=0.0)
    figure(f"router {name} killed: longest silence of the others", others, UNTOUCHED_S, alone)


def test_down_leaves_no_process_and_no_socket(up: tuple[Machines, float], figure: Figure) -> None:
    fleet = up[0]
    done = fleet.lfa("down", str(fleet.fleet_file), "--json")
    assert done.returncode == 0, done.stderr
    left = {name: [*fleet.processes(name), *fleet.sockets(name)] for name in fleet.names}
    assert left == {name: [] for name in fleet.names}
    figure("lfa down: nothing is left on any host", json.loads(done.stdout)["took_s"], DOWN_S)
