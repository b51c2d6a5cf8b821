"""Plug-ins from a file `FILE.py:Class`, without installing: sensors, behaviours and generators, as controllers are."""

from __future__ import annotations

from pathlib import Path

import pytest

from lfa.deploy.own_code import PLUG_INS, chosen_files, with_own_code
from lfa.deploy.recording.run_folder import About
from lfa.deploy.run.process_table import granted_row, rows
from lfa.deploy.scenario_loading import load_scenario
from lfa.protocol.errors import Refused
from tests.rigs.lfa_runs import lfa
from tests.test_imports import ROOT

EXAMPLES = ROOT / "deploy" / "examples"
LIGHT, CAREFUL = f"{EXAMPLES}/10_own_sensor.py:Light", f"{EXAMPLES}/10_own_sensor.py:Careful"
CAUTIOUS, SLALOM = f"{EXAMPLES}/12_own_behavior.py:Cautious", f"{EXAMPLES}/09_own_generator.py:Slalom"
ALL = ("--sensor", LIGHT, "--controller", CAREFUL, "--behavior", CAUTIOUS)
SHORT = ("--robots", "2", "--set", "goal=1.0,0")
TYPED = """
from __future__ import annotations
from dataclasses import dataclass
from msgspec import Struct

@dataclass
class Memory:
    last: float | None = None

class Own:
    class Parameters(Struct, frozen=True):
        kept: dict[str, Memory] | None = None
        gain: float = 1.0

    def __init__(self, scenario, chance, parameters):
        self.gain = parameters.gain

    def measure(self, state):
        return {"gain": self.gain}
"""


@pytest.fixture(autouse=True)
def _nothing_added(monkeypatch: pytest.MonkeyPatch) -> None:
    for plug_ins in PLUG_INS.values():
        monkeypatch.setattr(plug_ins, "_added", {})
        monkeypatch.setattr(plug_ins, "_files", {})


def test_a_run_with_plug_ins_from_files_keeps_copies_and_is_verified_with_them(tmp_path: Path) -> None:
    done = lfa("sim", "straight", *SHORT, *ALL, "--out", str(tmp_path / "run"))
    assert done.returncode == 0, done.stderr
    copies = {path.name for path in (tmp_path / "run").glob("*.py")}
    assert copies == {"10_own_sensor.py", "12_own_behavior.py"}
    asked = ["verify", str(tmp_path / "run")]
    for option, says in (
        ("--controller", f"add --controller {tmp_path}/run/10_own_sensor.py:Careful"),
        ("--behavior", f"add --behavior {tmp_path}/run/12_own_behavior.py:Cautious"),
        ("--sensor", f"add --sensor {tmp_path}/run/FILE.py:Light"),
    ):
        refused = lfa(*asked)
        assert refused.returncode == 2
        assert says in refused.stderr
        asked += [option, {"--sensor": LIGHT, "--controller": CAREFUL, "--behavior": CAUTIOUS}[option]]
    checked = lfa(*asked)
    assert checked.returncode == 0, checked.stderr
    assert "0 violations" in checked.stdout


def test_a_generator_from_a_file_is_a_scenario_of_one_run_and_of_many(tmp_path: Path) -> None:
    assert lfa("validate", SLALOM).stdout.endswith("Slalom: ok, 4 robots, at most 120 s\n")
    short = ("--robots", "1", "--set", "time_limit_s=2", "--set", "assert.goal_reached=false")
    for more in (("--seed", "3"), ("--seeds", "3..4", "--jobs", "2")):
        done = lfa("sim", SLALOM, *short, "--sensor", LIGHT, *more, "--out", str(tmp_path / f"out{len(more)}"))
        assert done.returncode == 0, done.stderr
    assert "2 of 2 done, 0 not good" in done.stdout


def test_a_sensor_named_on_the_command_line_measures_at_the_rate_that_the_scenario_gives(tmp_path: Path) -> None:
    file = tmp_path / "lit.toml"
    file.write_text('title = "lit"\ntime_limit_s = 5.0\n[mission]\nrobots = [1]\n[mission.leading]\n'
                    "route_m = [[1.0, 0.0]]\n[world.sensors.Light]\nrate_hz = 3.0\n")  # fmt: skip
    by_file = load_scenario(str(file), with_own_code(str(file), [], sensors=[LIGHT]))
    by_set = load_scenario("straight", with_own_code("straight", ["world.sensors.Light.rate_hz=4"], sensors=[LIGHT]))
    by_none = load_scenario("straight", with_own_code("straight", [], sensors=[LIGHT]))
    assert [one.world.sensors["Light"].rate_hz for one in (by_file, by_set, by_none)] == [3.0, 4.0, 10.0]


def test_each_process_of_a_run_is_given_the_files_that_it_needs(tmp_path: Path) -> None:
    chosen = with_own_code("straight", [], CAREFUL, [CAUTIOUS], [LIGHT])
    scenario = load_scenario("straight", chosen, 2)
    words = {
        one.name: " ".join(one.arguments)
        for one in rows(tmp_path, About("straight", "real", 0, "f"), "e", scenario, "")
    }
    assert f"--sensor {LIGHT}" in words["world"]
    assert f"--controller {CAREFUL} --behavior {CAUTIOUS}" in words["robot2"]
    assert "--sensor" not in words["robot2"]
    granted = granted_row(2, 1, "endpoint", "f", scenario.mission, spare=False)
    assert f"--controller {CAREFUL} --behavior {CAUTIOUS}" in " ".join(granted.arguments)
    assert {one.kind for one in chosen_files(scenario)} == {"controller", "behavior", "sensor"}


def test_the_types_of_a_file_are_found_though_their_names_are_resolved_late(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(TYPED)
    sets = with_own_code("straight", ["world.sensors.Own.parameters.gain=3"], sensors=[f"{tmp_path}/own.py:Own"])
    scenario = load_scenario("straight", sets, 1)
    assert scenario.world.sensors["Own"].parameters == {"gain": 3.0}


@pytest.mark.parametrize(("kind", "option"), [("sensor", "--sensor "), ("behavior", "--behavior "), ("generator", "")])
@pytest.mark.parametrize(
    ("code", "says"),
    [
        (None, "own.py:Own: no such file, must be FILE.py:Class"),
        ("class Other: pass", "own.py has no class 'Own', must be FILE.py:Class"),
        ("x = 1\nraise ValueError('no')", "own.py:Own: own.py:2: ValueError: no"),
    ],
)
def test_a_file_without_the_class_is_refused_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str, option: str, code: str | None, says: str
) -> None:
    monkeypatch.chdir(tmp_path)
    if code is not None:
        (tmp_path / "own.py").write_text(code)
    with pytest.raises(Refused) as refused:
        PLUG_INS[kind].add_file("own.py:Own")
    (line,) = refused.value.lines
    assert line.startswith(option)
    assert says in line


@pytest.mark.parametrize("name", ["run", "sim"])
def test_one_run_takes_the_options_of_all_plug_ins(name: str) -> None:
    said = lfa(name, "--help")
    assert said.returncode == 0, said.stderr
    assert [option for option in ("--controller", "--behavior", "--sensor") if option not in said.stdout] == []


def test_a_scenario_file_loads_no_code(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text("raise SystemExit(9)")
    with pytest.raises(Refused, match=r"or given by --behavior FILE\.py:Class"):
        load_scenario("straight", [f"mission.behaviors=['{tmp_path}/own.py:Own']"])
    with pytest.raises(Refused):
        load_scenario(f"{tmp_path}/own.py:Own")
    assert chosen_files(load_scenario("straight")) == ()
