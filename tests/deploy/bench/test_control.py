"""`lfa bench control`: rows are judged as they should be, and a wrong sign in the slot's velocity is seen."""

from __future__ import annotations

import json
from math import nan

import pytest

import lfa.agents.formation.slot_motion
from lfa.deploy.bench import control
from lfa.deploy.bench.control_cases import string_stability
from lfa.deploy.bench.control_cases.table import steady
from lfa.deploy.bench.harness.rows import Quantity, row, select
from lfa.protocol.errors import Refused


@pytest.mark.parametrize(
    ("rule", "bar", "value", "ok"),
    [
        ("at most", 2.0, 2.0, True),
        ("at most", 2.0, 2.1, False),
        ("at most", 2.0, nan, False),
        ("at least", 0.45, 0.4, False),
        ("at least", 0.45, 0.5, True),
        ("near", 1.5, 1.64, True),
        ("near", 1.5, 1.66, False),
        ("near", 1.5, 1.3, False),
        ("no worse", 1.5, 1.0, True),
        ("no worse", 1.5, 1.7, False),
        ("no worse", 1.5, 0.5, False),
        ("same", 1.0, 1.009, True),
        ("same", 1.0, 1.02, False),
    ],
)
def test_a_row_holds_when_its_rule_says_so(rule: str, bar: float, value: float, ok: bool) -> None:
    assert row("case", Quantity("x", "mm", bar, rule), value).ok is ok  # type: ignore[arg-type]


def test_a_value_without_bar_is_only_reported_unless_it_is_no_number() -> None:
    assert row("case", Quantity("x", "mm"), 5.0).ok
    assert not row("case", Quantity("x", "mm"), nan).ok


def test_row_names_are_unique() -> None:
    names = [name for case in control.cases() for name in case.row_names()]
    assert len(names) == len(set(names))


def test_an_unknown_row_is_refused_with_the_groups() -> None:
    with pytest.raises(Refused, match="clean"):
        select(control.cases(), "nothing/*")


def test_json_holds_every_chosen_row_with_bar_and_ok(capsys: pytest.CaptureFixture[str]) -> None:
    assert control.run(True, "goal/*", 1) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert [r["name"] for r in rows] == ["goal/left/at rest F1", "goal/left/at rest F3"]
    assert all(r["ok"] and r["bar"] > 0.0 and r["unit"] == "s" for r in rows)


def test_a_wrong_sign_of_k_omega_in_the_slot_velocity_makes_the_bench_fail(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """(21)/(22) in the opposite bearing convention, as printed."""
    right = lfa.agents.formation.slot_motion.slot_velocity
    monkeypatch.setattr(
        lfa.agents.formation.slot_motion, "slot_velocity", lambda theta, v, w, dx, dy: right(theta, v, -w, dx, dy)
    )
    assert control.run(True, "clean/circle/left/*", 1) == 1
    failed = {r["name"] for r in json.loads(capsys.readouterr().out)["rows"] if not r["ok"]}
    assert "clean/circle/left/distance rms" in failed


def test_a_seed_gives_the_same_values_again() -> None:
    assert steady("network", "circle", "left") == steady("network", "circle", "left")


def test_dead_reckoning_amplifies_by_1_plus_K_tau_at_most_and_a_buffer_does_not() -> None:
    """Control.md 5.1: sup |G| = 1 + K tau = 1.03 at 20 ms; delayed tracking is exactly 1."""
    schemes = {scheme.name: scheme for scheme in string_stability.SCHEMES}
    for name, low, high in (("vel, DR, 20 ms", 1.02, 1.031), ("vel, 40 ms", 0.999, 1.001)):
        deviations = string_stability.speed_wave(schemes[name], 4.0, 3)
        hop = (deviations[3] / deviations[0]) ** (1.0 / 3.0)
        assert low < hop < high, name
