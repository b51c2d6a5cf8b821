"""What a robot's gateway knows reaches its process in the schedules of `lfa fuzz`, as it does in an agent."""

from __future__ import annotations

from lfa.deploy.fuzz.fault_injector import play
from lfa.deploy.fuzz.search.lagging import draw_lagging

TOLD_BY_ITS_GATEWAY_ALONE = 55
"""Seed in which all start anew at once, one with a clock set back, and this one leads before it hears its gateway."""


def test_e23_a_leader_whose_gateway_knows_a_later_incarnation_starts_anew() -> None:
    played = play(draw_lagging(TOLD_BY_ITS_GATEWAY_ALONE))
    assert played.violations == [], f"reproduce: lfa fuzz --lagging --seed {TOLD_BY_ITS_GATEWAY_ALONE} -v"
