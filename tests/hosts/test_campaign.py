"""Round after round of drawn faults on a team in network namespaces; at the end the journals of it all are judged."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Sequence
from random import Random

import pytest

from lfa.deploy.bench.harness.team import Team
from lfa.protocol.names import robot_name
from lfa.protocol.topics import WORLD_NAME
from lfa.protocol.transport.link_model import LINK_CONDITIONS
from tests.rigs.live_team import check_terms, pass_time
from tests.rigs.network_namespaces import ROBOTS, WORLD_HOST, Net, missing, team_on_hosts

WHY_NOT = missing()
pytestmark = [pytest.mark.campaign, pytest.mark.skipif(WHY_NOT is not None, reason=str(WHY_NOT))]

ROUNDS = int(os.environ.get("LFA_ROUNDS", "100"))
SEED = os.environ.get("LFA_SEED", "1")
WHOLE_S = 40.0
"""From healing to one chain of all: a robot that was stopped for 15 s lost its links, and a world starts again."""
STOP_S = (0.05, 0.2, 0.5, 2.0, 15.0)

Undo = Callable[[], object]


class Faults:
    """One method a kind: does it to the team, and returns what undoes it."""

    def __init__(self, team: Team, net: Net, chance: Random) -> None:
        self._team, self._net, self._chance = team, net, chance
        self.for_s = 0.0
        """How long the fault is to last."""

    def kill(self, chain: Sequence[int]) -> Undo:
        return self._end(chain, signal.SIGKILL)

    def terminate(self, chain: Sequence[int]) -> Undo:
        return self._end(chain, signal.SIGTERM)

    def stop(self, chain: Sequence[int]) -> Undo:
        self.for_s = self._chance.choice(STOP_S)
        victims = self._some(chain)
        for victim in victims:
            self._team.signal(victim, signal.SIGSTOP)
        return lambda: [self._team.signal(victim, signal.SIGCONT) for victim in victims]

    def cut(self, chain: Sequence[int]) -> Undo:
        side = self._some([*chain, WORLD_HOST])[: len(chain)]
        self._net.cut(side, [host for host in (*chain, WORLD_HOST) if host not in side])
        return self._net.heal

    def half_cut(self, chain: Sequence[int]) -> Undo:
        """Some do not hear some others, who hear them: at the receivers."""
        places = [*(robot_name(robot) for robot in chain), WORLD_NAME]
        deaf, mute = self._chance.sample(places, 2), self._chance.sample(places, 2)
        self._team.order(LINK_CONDITIONS, cut=[(a, b) for a in mute for b in deaf if a != b])
        return self._team.heal

    def lose_messages(self, _chain: Sequence[int]) -> Undo:
        self._team.order(
            LINK_CONDITIONS,
            radio={"loss": self._chance.uniform(0.1, 0.3), "loss_burst": self._chance.choice((1.0, 4.0))},
        )
        return self._team.heal

    def lose_packets(self, _chain: Sequence[int]) -> Undo:
        self._net.lose(self._chance.choice((10, 20, 30)))
        return self._net.heal

    def reset(self, chain: Sequence[int]) -> Undo:
        self._net.reset(self._chance.choice((chain[0], *chain)))
        return self._net.heal

    def router(self, chain: Sequence[int]) -> Undo:
        return self._end_one(f"router{self._chance.choice(chain)}")

    def world(self, _chain: Sequence[int]) -> Undo:
        return self._end_one(WORLD_NAME)

    def handover(self, _chain: Sequence[int]) -> Undo:
        self._team.order("handover")
        return lambda: None

    def _end(self, chain: Sequence[int], number: signal.Signals) -> Undo:
        victims = self._some(chain)
        for victim in victims:
            self._team.signal(victim, number)
        return lambda: self._team.restart(*victims)

    def _end_one(self, name: str) -> Undo:
        self._team.signal(name, signal.SIGKILL)
        return lambda: self._team.restart(name)

    def _some(self, of: Sequence[int]) -> list[int]:
        """The first in half of the cases; now and then several, or all."""
        count = self._chance.choice((1, 1, 1, 2, 2, 3, len(of)))
        return list(of[:count]) if self._chance.random() < 0.5 else self._chance.sample(list(of), count)


KINDS = [name for name in vars(Faults) if not name.startswith("_")]


def test_drawn_faults_round_after_round_break_no_invariant_and_all_come_together_again() -> None:
    chance = Random(SEED)
    with team_on_hosts() as (team, net):
        faults = Faults(team, net, chance)
        for number in range(ROUNDS):
            chain = team.await_chain(ROBOTS, WHOLE_S)
            check_terms(team)
            team.heard.events.clear()
            kind = chance.choice(KINDS)
            faults.for_s = chance.choice((0.0, 0.05, 0.5, 2.0))
            print(f"{number:4} chain {chain}: {kind}", flush=True)
            undo = getattr(faults, kind)(chain)
            pass_time(team, faults.for_s)
            undo()
        team.await_chain(ROBOTS, WHOLE_S)
        assert team.judged().broken == (), f"reproduce: LFA_SEED={SEED} LFA_ROUNDS={ROUNDS} make test-campaign"
