"""`lfa fuzz --whole`: whole agents under the same schedules, watched by the same checkers."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest
from msgspec.structs import replace

from lfa.deploy.fuzz.fault_injector import play_whole
from lfa.deploy.fuzz.schedules import KINDS, LEADER, ScheduledFault, draw, draw_whole
from lfa.deploy.fuzz.search.searches import shrink
from lfa.protocol.lease.gateway import Gateway
from tests.protocol.lease import plants_of_stops as stops

SEEDS = (2, 3, 4, 7, 8, 14, 15, 18, 19)
"""Small teams, which are quick; between them every kind of fault."""


def test_whole_agents_keep_every_invariant_and_every_kind_of_fault_takes_effect() -> None:
    seen: set[str] = set()
    for seed in SEEDS:
        played = play_whole(draw(seed))
        assert played.violations == [], f"reproduce: lfa fuzz --whole --seed {seed} -v"
        seen |= set(+played.counts)
    assert seen == set(KINDS)


@pytest.mark.parametrize("drawn", [[], ["--lagging"]])
def test_one_seed_is_one_run_under_any_hash_seed(drawn: list[str]) -> None:
    fuzz = [sys.executable, "-c", "from lfa.deploy.cli import main; main()", "fuzz", "--whole", *drawn]
    command = [*fuzz, "--seed", "14", "-v"]
    told = [
        subprocess.run(command, env={**os.environ, "PYTHONHASHSEED": number}, capture_output=True, check=True).stdout
        for number in ("1", "2")
    ]
    assert told[0] == told[1]
    assert len(told[0].splitlines()) > 50


@pytest.mark.parametrize("seed", [2, 7])
def test_i10_holds_for_whole_agents_that_operators_stop_also_when_the_leader_is_lost_at_that_moment(seed: int) -> None:
    schedule = draw_whole(seed)
    said = [call.at for call in schedule.stops if call.kind == "stop"]
    lost = [fault for fault in schedule.faults if fault not in draw(seed).faults]
    assert all(fault.targets == (LEADER,) and any(0.0 <= at - fault.at <= 0.02 for at in said) for fault in lost)
    played = play_whole(schedule)
    assert played.violations == [], f"reproduce: lfa fuzz --whole --seed {seed} -v"
    assert any(outcome.complete for _, _, outcome in played.stops)


def test_i10_a_whole_agent_that_drives_after_it_has_acknowledged_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    stops.stop_is_not_held(monkeypatch)
    played = play_whole(draw_whole(7))
    assert {"I10", "I16"} <= {violation.name for violation in played.violations}
    assert played.broken is not None
    assert played.broken.rules == ("E28",)


@pytest.mark.usefixtures("forgetful_voter")
def test_a_voter_that_forgets_its_bond_is_found_and_few_faults_are_enough() -> None:
    loss, duplicate = ScheduledFault(1.2, "loss", (), 0.2, 0.1), ScheduledFault(2.5, "duplicate", (), 0.2, 0.2)
    deaf = ScheduledFault(1.5, "cut_pair", (LEADER, 2), 1.0)  # robot 2 hears the leader no more, everybody else does
    bad = replace(draw(3), faults=(loss, deaf, duplicate))
    name = play_whole(bad).violations[0].name
    small = shrink(bad, name, play_whole)
    assert len(small.faults) < len(bad.faults)
    assert any(v.name == name for v in play_whole(small).violations)


def test_a_gateway_that_obeys_everybody_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Gateway, "_objection", lambda *_: None)
    assert "I2" in {violation.name for violation in play_whole(draw(2)).violations}
