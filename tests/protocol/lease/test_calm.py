"""Short cuts of a leader and of its deadlines: what they answer is what a look at everything would have answered."""

from __future__ import annotations

from random import Random

import pytest

from lfa.deploy.fuzz.fault_injector import play
from lfa.deploy.fuzz.lease_simulation import LeaseSimulation
from lfa.deploy.fuzz.schedules import draw
from lfa.protocol.lease.machine import leadership
from lfa.protocol.lease.machine.deadlines import WAKES
from lfa.protocol.lease.machine.lease import SOONEST, Lease
from lfa.protocol.lease.machine.memory import LeaseMemory
from lfa.protocol.lease.machine.table import state_of
from lfa.protocol.lease.reconfiguration import reshaped
from lfa.protocol.messages.consensus import Roster
from lfa.protocol.transport.link_model import Radio

ROBOTS = 9
"""More than may vote, so that some robots say HELLO all the time."""


def disturbed(seed: int) -> LeaseSimulation:
    """A team whose robots die with and without a hint, stand still, and return, over a radio that loses messages."""
    chance = Random(seed)
    team = LeaseSimulation(ROBOTS, seed=seed, radio=Radio(loss=0.05)).start_all()
    for n in range(12):
        at, robot = 1.0 + 0.7 * n + chance.random(), 1 + chance.randrange(ROBOTS)
        team.at(at, lambda robot=robot, hinted=n % 2 == 0: team.kill(robot, hinted=hinted))
        team.at(at + chance.choice((0.2, 0.9, 2.0)), team.start, robot)
    still = ROBOTS - 1
    team.at(1.0, lambda: team.pause(still))
    team.at(2.0, lambda: team.resume(still))
    return team


@pytest.mark.parametrize("seed", range(3))
def test_a_leader_that_does_not_look_at_its_chain_would_have_kept_it(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    looked = {True: 0, False: 0}
    honest = leadership.change_roster

    def checked(m: LeaseMemory, roster: Roster, now: float) -> None:
        assert m.holder is not None
        own = roster is m.config.roster
        calm = own and m.calm.holds(m.config, m.holder, m.peers, m.left_out, m.timing, now)
        looked[not calm] += 1
        if calm:
            anew = reshaped(m.config, m.holder, m.me, m.peers, m.left_out, m.policy, m.timing, now, roster)
            assert anew is m.config
        honest(m, roster, now)

    monkeypatch.setattr(leadership, "change_roster", checked)
    disturbed(seed).run(12.0)
    assert looked[False] > looked[True] > 0


@pytest.mark.parametrize("seed", [25, 104, 120])
def test_a_voter_outside_of_the_chain_is_taken_in_at_its_hello(seed: int) -> None:
    """A robot over which the chain was closed may still vote when it says HELLO; the chain was kept without it."""
    assert play(draw(seed)).violations == [], f"reproduce: lfa fuzz --seed {seed} -v"


@pytest.mark.parametrize("seed", range(3))
def test_a_deadline_that_is_remembered_is_the_present_one(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    honest = Lease.next_deadline

    def checked(lease: Lease, again_at: float = SOONEST) -> float:
        m, said = lease._memory, honest(lease, again_at)
        assert said == min(wakes(m, again_at) for wakes in WAKES[state_of(m)])
        return said

    monkeypatch.setattr(Lease, "next_deadline", checked)
    disturbed(seed).run(8.0)
