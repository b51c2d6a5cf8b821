"""A sensor of a user's own: an installed class measures the true state; its faults fail the run in one line."""

from __future__ import annotations

import re
import sys
from math import inf
from pathlib import Path

import msgspec
import pytest

from lfa.agents.perception.own_readings import SENSORS_MAX, OwnReadings
from lfa.deploy.scenario_loading import load_scenario
from lfa.deploy.simulate import read, run
from lfa.protocol.errors import Refused
from lfa.protocol.geometry import STILL, Pose2D
from lfa.protocol.messages.codec import BadMessage, decode, encode
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.robot import SensorReading
from lfa.world.description.own_sensor import SENSORS, TrueState
from lfa.world.sensors.own_sensors import OwnSensors
from tests.rigs.installed_plug_in import install
from tests.rigs.lfa_runs import lfa
from tests.rigs.world_rig import Rig, of
from tests.test_imports import ROOT

EXAMPLE = (ROOT / "deploy" / "examples" / "10_own_sensor.py").read_text()
POINTS = {"lfa.sensors/light": "own_sensor:Light", "lfa.controllers/careful": "own_sensor:Careful"}
SHORT = ("--robots", "2", "--set", "goal=1.5,0")
BROKEN = """
class Broken:
    def __init__(self, scenario, chance):
        pass

    def measure(self, state):
        {does}
"""


@pytest.fixture
def light(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    install(tmp_path, "own_sensor", EXAMPLE, POINTS)
    monkeypatch.syspath_prepend(tmp_path)
    return tmp_path


def test_each_robot_measures_from_where_it_truly_is_at_the_sensors_rate(light: Path) -> None:
    rig = Rig("world.sensors.light.rate_hz=4", "mission.robots=[1, 2]")
    rig.run(2.0)
    readings = of(rig.said, SensorReading)
    assert {reading.sensor for reading in readings} == {"light"}
    assert len(readings) in (16, 18)
    lux = {robot: [r.values["lux"] for r in readings[n::2]] for n, robot in ((0, 1), (1, 2))}
    assert all(abs(value - 100.0) < 1.0 for value in lux[1]), "robot 1 stands under the lamp"
    assert all(abs(value - 100.0 / 2.44) < 1.0 for value in lux[2]), "robot 2 stands 1.2 m away"


def test_a_further_sensor_changes_nothing_else(light: Path) -> None:
    noisy = ["world.noise.localization_m=0.1", "world.noise.range_m=0.1", "mission.robots=[1]"]
    bare, more = Rig(*noisy), Rig(*noisy, "world.sensors.light.rate_hz=9")
    said = []
    for rig in (bare, more):
        rig.run(1.0)
        kept = [one for one in rig.said if not isinstance(one.message, SensorReading)]
        said.append([(one.key, one.message) for one in kept if one.key.split("/")[3] in ("localization", "scan")])
    assert said[0] == said[1]


@pytest.mark.parametrize(
    ("does", "says"),
    [
        ("raise SystemExit(0)", "broken_sensor.py:7: SystemExit: 0"),
        ("return 1 / 0", "broken_sensor.py:7: ZeroDivisionError: division by zero"),
        ("return 3.5", "broken_sensor.py:6: measure returned a value of type float, must be a dict"),
        ("return {'c': float('nan')}", "broken_sensor.py:6: measure returned c = nan, must be a finite number"),
        ("return {'c': 10**400}", f"broken_sensor.py:6: measure returned c = 1{400 * '0'}, must be a finite number"),
        ("return {'c': 'warm'}", "broken_sensor.py:6: measure returned c = warm, must be a finite number"),
    ],
)
def test_a_fault_of_a_sensor_fails_the_run_with_its_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, does: str, says: str
) -> None:
    install(tmp_path, "broken_sensor", BROKEN.format(does=does), {"lfa.sensors/broken": "broken_sensor:Broken"})
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "broken_sensor", raising=False)
    sets = ["world.sensors.broken.rate_hz=5", "goal=1,0"]
    summary = run("straight", robots=1, set=sets, out=tmp_path / "run").summary
    assert (summary.outcome, summary.exit_code) == ("failed", 1)
    assert summary.reason == f"sensor broken of robot 1: {says}"


LONG = "n" * 65
BAD_VALUES = {
    "a number that no core could hold": ({"c": 1e10}, "measure returned c = 10000000000.0, must be a finite number"),
    "infinite": ({"c": -inf}, "measure returned c = -inf, must be a finite number"),
    "a name that is no text": ({5: 1.0}, "measure returned the name 5, must be a text of at most 64 characters"),
    "a long name": (
        {"n" * 65: 1.0},
        f"measure returned the name '{'n' * 65}', must be a text of at most 64 characters",
    ),
    "many values": ({f"v{n}": 1.0 for n in range(65)}, "measure returned 65 values, at most 64 fit"),
}


def own_sensors(answers: list[object], monkeypatch: pytest.MonkeyPatch) -> tuple[OwnSensors, TrueState]:
    """The sensor `said` of two robots, which give these answers in turn, and the state of the second robot."""

    class Said:
        def __init__(self, *_: object) -> None: ...

        def measure(self, _: object) -> object:
            return answers.pop(0)

    monkeypatch.setattr(SENSORS, "_added", {"said": Said})
    scenario = load_scenario("straight", ["world.sensors.said.rate_hz=5", "mission.robots=[1, 2]"])
    return OwnSensors(scenario, 1, (1, 2)), TrueState(2, 0.0, Pose2D(), STILL, 0.0, {}, ())


@pytest.mark.parametrize("kind", BAD_VALUES)
def test_a_sensor_with_a_bad_answer_is_told_of_once_and_not_called_again(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    answer, says = BAD_VALUES[kind]
    answers: list[object] = [answer, {"c": 1.0}]
    sensors, state = own_sensors(answers, monkeypatch)
    said = sensors.measure("said", state)
    assert isinstance(said, str)
    assert re.fullmatch(rf"sensor said of robot 2: test_own_sensors\.py:\d+: {re.escape(says)}", said)
    assert sensors.measure("said", state) is None
    assert answers == [{"c": 1.0}]


def test_what_fits_just_so_is_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    most = {f"{n:064}": (-1e9, 1e9, 3)[n % 3] for n in range(64)}
    sensors, state = own_sensors([most], monkeypatch)
    assert sensors.measure("said", state) == most


def test_a_run_is_read_where_its_sensor_is_not_installed(light: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sets = ["world.sensors.light.rate_hz=5", "goal=0.5,0"]
    run("straight", robots=1, set=sets, out=light / "run")
    monkeypatch.setattr(sys, "path", [path for path in sys.path if not (Path(path) / "own_sensor.py").is_file()])
    monkeypatch.setattr(SENSORS, "_added", {})  # a script run in this process may have added it by hand
    assert SENSORS.names() == []
    assert read(light / "run").readings[1]["light"]


def test_a_measurement_may_drop_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Silent:
        def __init__(self, *_: object) -> None: ...

        def measure(self, _: object) -> None: ...

    monkeypatch.setattr(SENSORS, "_added", {"silent": Silent})
    rig = Rig("world.sensors.silent.rate_hz=5", "mission.robots=[1]")
    rig.run(1.0)
    assert of(rig.said, SensorReading) == []


@pytest.mark.parametrize(
    ("override", "says"),
    [
        ("world.sensors.lamp.rate_hz=5", "world.sensors.lamp: no sensor 'lamp': must be one of the entry points"),
        ("world.sensors.light.rate_hz=0", "world.sensors.light.rate_hz = 0.0: must be above 0 and at most"),
        ("world.sensors.light.parameters.lamp_m=5", "world.sensors.light.parameters.lamp_m = 5.0: Expected `array`"),
        ("world.sensors.light.rate=5", "world.sensors.light.rate = 5: no such key: did you mean 'rate_hz'?"),
    ],
)
def test_a_sensor_that_cannot_be_is_refused_before_anything_starts(light: Path, override: str, says: str) -> None:
    with pytest.raises(Refused) as refused:
        load_scenario("straight", [override])
    assert says in refused.value.lines[0]


def test_an_installed_sensor_is_listed_and_its_controller_reads_it(
    light: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONPATH", str(light))
    kinds = {row["name"]: row["kind"] for row in msgspec.json.decode(lfa("list", "--json").stdout)}
    assert (kinds["light"], kinds["careful"]) == ("sensor", "controller")
    sensed = ("--set", "world.sensors.light.rate_hz=5", "--set", "world.sensors.light.parameters.lamp_m=[90.0, 0.0]")
    settled = {}
    for controller in ("law", "careful"):
        out = light / controller
        done = lfa("sim", "straight", *SHORT, *sensed, "--controller", controller, "--out", str(out))
        assert done.returncode == 0, done.stderr
        summary = msgspec.json.decode((out / "summary.json").read_bytes())
        settled[controller] = summary["robots"][1]["distance_error_max_m"]
    assert settled["law"] < 0.02 < settled["careful"], "in the dark the careful controller falls behind"


def test_readings_are_kept_by_sensor_with_their_ages_and_their_number_is_bounded() -> None:
    readings = OwnReadings()
    for n in range(SENSORS_MAX + 5):
        readings.update(SensorReading(Header("world", 1, n, 0.0), f"s{n}", {"v": 1.0}), 10.0)
    readings.update(SensorReading(Header("world", 1, 99, 0.0), "s0", {"v": 2.0}), 11.0)
    now = readings.at(11.5)
    assert len(now) == SENSORS_MAX
    assert (now["s0"].values, now["s0"].age_s, now["s1"].age_s) == ({"v": 2.0}, 0.5, 1.5)


@pytest.mark.parametrize("values", [{"v": float("nan")}, {"v" * 65: 1.0}, {f"v{n}": 1.0 for n in range(65)}])
def test_a_reading_that_no_core_could_hold_is_refused(values: dict[str, float]) -> None:
    with pytest.raises(BadMessage):
        decode(encode(SensorReading(Header("robot1", 1, 1, 0.0), "light", values)), SensorReading)
