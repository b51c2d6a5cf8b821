"""How the rules of joining and retiring are broken on purpose, each by a patch."""

from __future__ import annotations

from typing import Any

import pytest

import lfa.protocol.lease.membership
import lfa.protocol.lease.reconfiguration
from lfa.protocol.lease.candidate import Candidate
from lfa.protocol.lease.election import Election
from lfa.protocol.lease.machine import resigning
from lfa.protocol.lease.machine.memory import LeaseMemory
from lfa.protocol.messages.consensus import Config, Roster


def spares_vote_like_others(patch: pytest.MonkeyPatch) -> None:
    honest = lfa.protocol.lease.membership.chosen

    def chosen(kept: Any, chain: Any, witness: Any, roster: Roster) -> Any:
        return honest(kept, chain, witness, Roster())

    patch.setattr(lfa.protocol.lease.membership, "chosen", chosen)
    patch.setattr(lfa.protocol.lease.reconfiguration, "chosen", chosen)


def strangers_are_taken_in(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(Election, "takes_in", lambda self, config, robot_id: robot_id not in config.roster.retired)


def retired_robots_stand(patch: pytest.MonkeyPatch) -> None:
    honest = Election.may_lead
    patch.setattr(
        Election,
        "may_lead",
        lambda self, config, robot_id: robot_id in config.roster.retired or honest(self, config, robot_id),
    )


def retired_candidates_go_on(patch: pytest.MonkeyPatch) -> None:
    honest = resigning.adopt

    def adopt(m: LeaseMemory, config: Config, now: float) -> None:
        candidate = m.candidate
        honest(m, config, now)
        m.candidate = candidate

    patch.setattr(resigning, "adopt", adopt)


def retired_robots_are_taken_in_again(patch: pytest.MonkeyPatch) -> None:
    honest = lfa.protocol.lease.reconfiguration.reshaped

    def reshaped(config: Config, *arguments: Any) -> Config:
        *others, roster = arguments
        return honest(config, *others, Roster(roster.spares) if config.roster == roster else roster)

    patch.setattr("lfa.protocol.lease.machine.leadership.reshaped", reshaped)


def spares_stand_for_a_full_house_without_them(patch: pytest.MonkeyPatch) -> None:
    honest = Candidate.full_house

    def full_house(self: Candidate, config: Config, universe: Any, superseded: Any) -> Any:
        return tuple(m for m in honest(self, config, universe, superseded) if m.id in universe)

    patch.setattr(Candidate, "full_house", full_house)
