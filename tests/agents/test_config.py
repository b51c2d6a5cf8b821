"""Gains that the loop or the drive cannot stand are refused, saying which rule."""

from __future__ import annotations

import pytest

from lfa.agents.config import DEFAULT, SHARP, Gains, check_gains
from lfa.agents.following.factory import follower_of, gains_of
from lfa.protocol.errors import Refused
from lfa.protocol.mission import Following, Limits, Mission


def test_the_default_gains_obey_all_rules() -> None:
    assert check_gains(DEFAULT, Limits()) is DEFAULT


@pytest.mark.parametrize(
    ("gains", "rule"),
    [
        (Gains(k_per_s=50.0, m_mps=0.01), "K dt = 1 must be below 1"),
        (Gains(k_per_s=3.0), r"K m = 1.5: must be at most a_max = 1"),
        (Gains(b_m=0.1), r"K m / b = 7.5: must be at most alpha_max = 4"),
        (SHARP, "allow_saturation"),
        (Gains(b_m=0.0), "gains.b_m = 0.0"),
        (Gains(k_per_s=float("nan")), "gains.k_per_s = nan"),
        (Gains(lambda_psi_per_s=60.0), "gains.lambda_psi_per_s"),
    ],
)
def test_a_broken_rule_is_named(gains: Gains, rule: str) -> None:
    with pytest.raises(Refused, match=rule):
        check_gains(gains, Limits())


def test_the_sharp_set_is_accepted_when_saturation_is_allowed_but_never_an_unstable_loop() -> None:
    assert check_gains(SHARP, Limits(), allow_saturation=True) is SHARP
    with pytest.raises(Refused, match="K dt"):
        check_gains(Gains(k_per_s=60.0), Limits(), allow_saturation=True)


def test_a_missions_gains_are_taken_by_name_and_unknown_ones_refused() -> None:
    assert gains_of(Mission(following=Following(gains={"k_per_s": 1.0}))) == Gains(k_per_s=1.0)
    with pytest.raises(Refused, match=r"mission.following.gains.*k_per_s"):
        gains_of(Mission(following=Following(gains={"K": 1.0})))


def test_an_unknown_controller_is_refused_with_the_installed_ones() -> None:
    with pytest.raises(Refused, match="headway, kanayama, law"):
        follower_of(Mission(following=Following(controller="pid")))
