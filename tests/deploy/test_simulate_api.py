"""A scenario from a notebook: `lfa.deploy.simulate.run`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lfa.deploy.simulate import run
from lfa.protocol.errors import Refused
from lfa.world.description.load import load

SHORT = ("mission.leading.route_m=[[3.0, 0.0]]",)


def test_a_run_comes_back_as_arrays_figures_and_a_summary(tmp_path: Path) -> None:
    done = run("straight", seed=7, set=SHORT, faults=["kill leader at 2 s"], out=tmp_path / "run")
    t, x, _, _, v, _ = done.truth[2].T
    assert np.all(np.diff(t) > 0.0)
    assert x[-1] == pytest.approx(3.0, abs=0.2)
    assert np.max(v) < 1.01
    assert set(done.errors) == {2, 3, 4}
    assert done.errors[3].distance.shape == done.errors[3].t.shape
    assert done.summary.outcome == "goal_reached"
    assert done.summary.seed == 7
    assert done.figure("fig07_distance_error").axes


def test_a_scenario_may_be_given_as_an_object(tmp_path: Path) -> None:
    assert run(load("straight", SHORT, 2), out=tmp_path / "run").robots == (1, 2)


def test_a_wrong_name_is_told_with_the_right_ones(tmp_path: Path) -> None:
    with pytest.raises(Refused, match="did you mean 'straight'"):
        run("strait")
    with pytest.raises(KeyError, match="must be one of fig09_path_flow"):
        run("straight", set=("time_limit_s=1.0",), out=tmp_path / "run").figure("fig1")
