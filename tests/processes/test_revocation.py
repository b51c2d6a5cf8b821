"""What `lfa keys revoke` heals: a secured fleet whose robot 3 is in foreign hands, and says terms of its own making."""

from __future__ import annotations

import signal

import pytest

from lfa.deploy.process.process_group import ROUTER_NAME
from lfa.protocol.lease.term_window import FREE
from tests.rigs.lfa_runs import lfa
from tests.rigs.secured_fleet import TRAITOR, Poison, attacked

pytestmark = pytest.mark.processes

HEALED_S = 30.0
POISONED = 20


def test_e26_after_made_up_terms_one_revocation_leaves_the_others_driving_on() -> None:
    """Nobody is started anew but the router, which shuts robot 3 out: its agent has the revoked keys too."""
    with attacked() as fleet:
        with fleet.open(fleet.unix) as attacker:
            poison = Poison(attacker)
            for number in (2**53, 2**53 - 1, FREE, *range(FREE + 1, FREE + POISONED)):
                poison.say(number)
        done = lfa("keys", "revoke", str(fleet.keys), TRAITOR)
        assert done.returncode == 0, done.stderr
        fleet.team.signal(ROUTER_NAME, signal.SIGHUP)
        fleet.team.wait_until(lambda: set(fleet.team.chain()) == {1, 2}, "robots 1 and 2 do not drive on", HEALED_S)
        assert fleet.refused(fleet.tls, TRAITOR)
