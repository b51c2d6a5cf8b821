"""A scenario generator: an installed class draws a course from the seed; its faults are refused in one line."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest

from lfa.deploy.recording.run_folder import toml
from lfa.protocol.errors import Refused
from lfa.world.description.load import draw, load
from tests.rigs.installed_plug_in import install
from tests.rigs.lfa_runs import lfa
from tests.test_imports import ROOT

EXAMPLE = (ROOT / "deploy" / "examples" / "09_own_generator.py").read_text()
POINT = {"lfa.scenarios/slalom": "own_generator:Slalom"}
BROKEN = """
from random import Random
from lfa.world.description.scenario import Obstacle, Scenario

class Broken:
    def generate(self, scenario: Scenario, chance: Random) -> Scenario:
        {does}
"""


@pytest.fixture
def slalom(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    install(tmp_path, "own_generator", EXAMPLE, POINT)
    monkeypatch.syspath_prepend(tmp_path)
    return tmp_path


def test_a_seed_gives_a_course_and_the_same_one_again(slalom: Path) -> None:
    scenario = load("slalom", ["generator.parameters.posts=4", "world.lidar.beams=90"], 2)
    first, again, other = draw(scenario, 7), draw(scenario, 7), draw(scenario, 8)
    assert first == again
    assert first.world.obstacles != other.world.obstacles
    assert len(first.world.obstacles) == 4
    assert (first.world.lidar.beams, first.mission.robots, first.generator) == (90, (1, 2), None)
    assert first.name == "slalom"


def test_a_drawn_course_is_a_file_that_needs_no_generator(slalom: Path, tmp_path: Path) -> None:
    drawn = draw(load("slalom"), 3)
    (tmp_path / "drawn.toml").write_text(toml(drawn))
    read = load(str(tmp_path / "drawn.toml"))
    assert draw(msgspec.structs.replace(read, name="slalom"), 3) == drawn


def test_a_file_names_a_generator_and_gives_what_it_starts_from(slalom: Path, tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    path.write_text('title = "x"\ntime_limit_s = 9.0\n[mission]\nrobots = [1, 2, 3]\n[generator]\nname = "slalom"\n')
    drawn = draw(load(str(path)), 1)
    assert (drawn.time_limit_s, drawn.mission.robots, len(drawn.world.obstacles)) == (9.0, (1, 2, 3), 3)


@pytest.mark.parametrize(
    ("overrides", "says"),
    [
        (["generator.parameters.posts=many"], "generator.parameters.posts = many: Expected `int`, got `str`"),
        (["generator.parameters.gates=2"], "generator.parameters.gates: no such parameter of slalom: known are"),
        (["generator.parameters.apart_m=1e6"], "scenario generator slalom, seed 0: mission.leading.route_m[0] = "),
        (["generator.name=slalon"], "generator: no scenario generator 'slalon': must be one of the entry points"),
        (["world.start=[0,0]"], "world.start = (0.0, 0.0): must be left out with a generator"),
    ],
)
def test_what_a_generator_cannot_make_is_refused_with_its_key(slalom: Path, overrides: list[str], says: str) -> None:
    with pytest.raises(Refused) as refused:
        draw(load("slalom", overrides), 0)
    assert says in refused.value.lines[0]


@pytest.mark.parametrize(
    ("does", "says"),
    [
        ("return None", "generate returned nothing, must be a Scenario"),
        ("return 1 / 0", "broken.py:7: ZeroDivisionError: division by zero"),
        ("return scenario", "mission.leading.route_m = []: must be at least one way-point"),
    ],
)
def test_a_fault_of_a_generator_is_a_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, does: str, says: str
) -> None:
    install(tmp_path, "broken", BROKEN.format(does=does), {"lfa.scenarios/broken": "broken:Broken"})
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(__import__("sys").modules, "broken", raising=False)
    with pytest.raises(Refused) as refused:
        load("broken")
    (line,) = refused.value.lines
    assert says in line


def test_an_installed_generator_is_listed_and_runs_by_its_name(slalom: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", str(slalom))
    listed = {row["name"]: row for row in msgspec.json.decode(lfa("list", "--json").stdout)}
    assert listed["slalom"] == {
        "name": "slalom", "kind": "scenario generator",
        "title": "Posts beside a straight way, at random distances from it.",
    }  # fmt: skip
    one = ("--robots", "1", "--set", "generator.parameters.posts=1", "--set", "generator.parameters.apart_m=1.5")
    done = lfa("sim", "slalom", "--seed", "2", *one, "--out", str(slalom / "run"), "--record", "summary")
    assert done.returncode == 0, done.stderr
    assert "slalom, simulated, seed 2: goal_reached" in done.stdout
