"""Pages for people who write their own driver, sensor or scenario: what stands on them runs as it stands there."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from lfa.agents.agent import Agent
from lfa.deploy.config import schema
from lfa.deploy.simulate import run
from lfa.protocol.geometry import STILL, Pose2D, Twist, along_arc
from lfa.protocol.mission import Leading, Mission
from lfa.protocol.runtime.journal import JOURNAL_VERSION, Heading, Journal
from lfa.protocol.transport.link_model import CLEAR
from lfa.world.description.own_sensor import SENSORS
from lfa.world.simulator import Simulator
from tests.test_paper_map import ROOT, names_of

DRIVER = (ROOT / "protocol" / "DRIVER.md").read_text()
SCENARIO = (ROOT / "world" / "SCENARIO.md").read_text()
PAGES = {"DRIVER": DRIVER, "SCENARIO": SCENARIO, "VIEW": (ROOT / "deploy" / "view" / "README.md").read_text()}
NAMED = sorted(
    {(page, quoted) for page, text in PAGES.items() for quoted in re.findall(r"`([a-z_/]+\.py(?::\w+)?)`", text)}
)
PICTURES = sorted({(page, path) for page, text in PAGES.items() for path in re.findall(r"!\[[^]]*\]\(([^)]+)\)", text)})


def _code(page: str, language: str) -> str:
    found = re.search(rf"```{language}\n(.*?)```", page, re.DOTALL)
    assert found is not None
    return found[1]


@pytest.mark.parametrize(("page", "quoted"), NAMED)
def test_a_file_and_a_name_on_a_page_exist(page: str, quoted: str) -> None:
    path, _, name = quoted.partition(":")
    assert (ROOT / path).is_file(), quoted
    assert not name or name in names_of(ROOT / path), quoted


@pytest.mark.parametrize(("page", "path"), PICTURES)
def test_a_picture_on_a_page_is_there_and_small(page: str, path: str) -> None:
    folder = {"DRIVER": "protocol", "SCENARIO": "world", "VIEW": "deploy/view"}[page]
    assert 0 < (ROOT / folder / path).stat().st_size < 150_000


class Base:
    """Wheels that do what they are told."""

    def __init__(self) -> None:
        self._pose, self._twist, self._way_m = Pose2D(), STILL, 0.0

    def drive(self, twist: Twist) -> None:
        self._twist = twist
        self._pose = along_arc(self._pose, twist, 0.02)
        self._way_m += abs(twist.linear_x) * 0.02

    def odometry(self) -> tuple[Pose2D, Twist, float]:
        return self._pose, self._twist, self._way_m

    def pose(self) -> Pose2D:
        return self._pose


def test_the_pages_driver_brings_a_robot_with_a_real_agent_to_its_goal() -> None:
    names: dict[str, Any] = {}
    exec(_code(DRIVER, "python"), names)
    base, simulator = Base(), Simulator(CLEAR, 1)
    mission = Mission((1,), witness=False, leading=Leading(route_m=((2.0, 0.5),), cruise_mps=0.5))
    heading = Heading(JOURNAL_VERSION, "", 1, 1, {})
    simulator.add(names["Driver"](base, "fleet", 1, 1), Journal(None, heading))
    simulator.add(Agent(1, 1, "fleet", 1, mission), Journal(None, heading))
    simulator.run(15.0)
    assert base.pose().x == pytest.approx(2.0, abs=0.1)
    assert base.pose().y == pytest.approx(0.5, abs=0.1)
    simulator.kill("robot1")
    simulator.run(15.5)
    assert base.odometry()[1] == STILL, "without its agent a robot stands"


def test_the_pages_scenario_runs_and_holds(tmp_path: Path) -> None:
    path = tmp_path / "my.toml"
    path.write_text(_code(SCENARIO, "toml"))
    summary = run(str(path), seed=7, out=tmp_path / "run").summary
    assert summary.exit_code == 0, [a for a in summary.assertions if not a.ok]
    assert {a.name for a in summary.assertions} >= {"contacts_max", "distance_error_rms_m"}


def test_the_pages_sensor_measures_and_is_recorded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    names: dict[str, Any] = {}
    exec(_code(SCENARIO, "python"), names)
    monkeypatch.setattr(SENSORS, "_added", {"battery": names["Battery"]})
    sets = ["world.sensors.battery.rate_hz=2", "goal=2,0"]
    done = run("straight", seed=7, robots=2, set=sets, out=tmp_path / "run")
    charges = [values["charge"] for _, values in done.readings[2]["battery"]]
    assert len(charges) > 8
    assert all(0.9 < charge < 1.1 for charge in charges)


def test_the_table_of_keys_is_the_one_that_the_types_give() -> None:
    assert SCENARIO.partition("# Every key")[2].strip().endswith(schema.table().strip()), (
        "keys have changed: make pages"
    )
