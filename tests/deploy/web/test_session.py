"""A session of the page is a scenario: saved or shared, it runs again byte for byte."""

from __future__ import annotations

import re
from math import hypot
from pathlib import Path
from random import Random

import pytest
from msgspec.structs import replace

from lfa.deploy.faults.script import parse_all
from lfa.deploy.run import simulate
from lfa.deploy.scenario_loading import load_scenario
from lfa.deploy.web.command import lighter
from lfa.deploy.web.share import Setting, fragment_of, setting_of
from lfa.deploy.web.virtual import VirtualEngine
from lfa.protocol.errors import Refused

SHORT = ("faults=['stop 3 at 2 s for 1.5 s']", "time_limit_s=6.5")
CLICKS = {
    0.4: ["loss 0.3"],
    1.1: ["obstacle 2.5,0.1,0.3", "formation column"],
    2.2: ["kill leader"],
    3.4: ["loss 0", "cut 4"],
    3.8: ["goal 2 3"],
    4.1: ["heal 4", "range 2.5", "restart 1", "goal 3,-2.5"],
    5.0: ["range 0", "hang scanner 2"],
}
"""What is clicked once so much virtual time [s] has passed."""


def clicked(setting: Setting, clicks: dict[float, list[str]]) -> VirtualEngine:
    """A session to the end of its run, played in uneven pieces."""
    engine, chance = VirtualEngine(setting), Random(1)
    left = dict(clicks)
    engine.obey({"do": "speed", "value": 1000})
    while not engine.over:
        for at_s in [at_s for at_s in left if engine.now >= at_s]:
            for text in left.pop(at_s):
                engine.obey({"do": "fault", "text": text})
        if chance.random() < 0.5:
            engine.obey({"do": "step"})
        else:
            engine.obey({"do": "play"})
            engine.advance()
            engine.obey({"do": "pause"})
    assert not left
    return engine


def test_a_saved_session_runs_to_the_same_events_byte_for_byte(tmp_path: Path) -> None:
    engine = clicked(Setting("leader_killed", seed=5, overrides=SHORT), CLICKS)
    answer = engine.obey({"do": "save"})
    (tmp_path / "saved.toml").write_text(answer["saved"])
    saved = load_scenario(str(tmp_path / "saved.toml"))
    simulate.run(saved, saved.seed, tmp_path / "run", parse_all(saved.mission, saved.faults, ()))
    again = (tmp_path / "run" / "events.jsonl").read_bytes()
    assert again == engine.events[0], f"lfa sim {tmp_path / 'saved.toml'}"
    deeds = (f'"deed":"{deed}"'.encode() for deed in ("obstacle", "goal", "range", "kill"))
    assert all(word in again for word in (*deeds, b'"kind":"order"', b'"index":0'))


def test_a_shared_link_is_the_run() -> None:
    engine = clicked(
        Setting("leader_killed", seed=5, overrides=(SHORT[0], "time_limit_s=3.0")),
        {0.5: ["kill 2"], 1.0: ["obstacle 3,-2,0.4"]},
    )
    again = VirtualEngine(setting_of(f"http://127.0.0.1:1/?token=x#{engine.state()['link']}"))
    again.obey({"do": "speed", "value": 1000})
    while not again.over:
        again.obey({"do": "play"})
        again.advance()
    assert again.events == engine.events


def test_a_setting_comes_back_from_its_link() -> None:
    setting = Setting("straight", -3, 6, ("world.lidar.beams=90",), ("cut 1>2 at 3.1 s", "kill 2 at 9 s"))
    assert setting_of(f"#{fragment_of(setting)}") == setting


@pytest.mark.parametrize(
    "link", ["#", "#run=", "#seed=1", "#run=a&run=b", "#run=a&token=b", "#run=a&seed=x", "#" + "x" * 30_000]
)
def test_a_link_that_is_none_is_refused_in_one_line(link: str) -> None:
    with pytest.raises(Refused) as refused:
        VirtualEngine(setting_of(link))
    assert "\n" not in str(refused.value)


ENGINE_REFUSES = [
    ({"do": "fault", "text": "kill 9"}, "no robot '9'"),
    ({"do": "fault", "text": "restart 2"}, "robot 2 runs"),
    ({"do": "fault", "text": "obstacle 0,0,0.3"}, "robot 1 stands there"),
    ({"do": "fault", "text": "obstacle 3,0,nan"}, "must be x, y and"),
    ({"do": "fault", "text": "goal 3,nan"}, "must be x and y"),
    ({"do": "fault", "text": "goal here"}, "must be x and y"),
    ({"do": "fault", "text": "kill world"}, "only in lfa run"),
    ({"do": "fault", "text": "kill 1 at 3 s"}, "must be like"),
    ({"do": "fault", "text": ""}, "must be like"),
    ({"do": "open", "link": "#run=/etc/passwd"}, "must be a shipped one"),
    ({"do": "open", "link": "#run=leader_killed&fault=hug+1+at+3+s"}, "must be like"),
    ({"do": "open", "link": "#run=leader_killed&set=world.map%3D/etc/passwd"}, "a link names no files"),
    ({"do": "lesson", "key": "x"}, "must be one of"),
    ({"do": "fly"}, "no such order"),
    ({}, "no such order"),
]


@pytest.mark.parametrize(("order", "why"), ENGINE_REFUSES)
def test_a_bad_order_is_refused_in_one_line_and_the_run_goes_on(order: dict[str, object], why: str) -> None:
    engine = VirtualEngine(Setting("leader_killed"))
    with pytest.raises(Refused) as refused:
        engine.obey(order)
    assert why in str(refused.value)
    number, before = engine.number, engine.now
    engine.obey({"do": "step"})
    assert engine.number == number and engine.now > before and engine.state()["faults"] == ["kill leader at 8 s"]


WALLED = Setting("straight", overrides=(
    "world.walls_m=[[-9, -9, 12, -9], [12, -9, 12, 9], [12, 9, -9, 9], [-9, 9, -9, -9], [3, 3, 5, 3]]",
    "mission.leading.route_m=[[9, 0]]",
    "world.obstacles=[{center_m=[5, -4], radius_m=1.0}]",
))  # fmt: skip


@pytest.mark.parametrize(
    ("goal", "why"),
    [("4,3", "in a wall"), ("13.5,0", "outside of the map or walled off"), ("5.5,-4", "on the obstacle at (5, -4)")],
)
def test_a_goal_that_cannot_be_reached_is_refused_in_one_line_clicked_or_written(goal: str, why: str) -> None:
    engine = VirtualEngine(WALLED)
    with pytest.raises(Refused, match=re.escape(why)) as refused:
        engine.obey({"do": "fault", "text": f"goal {goal}"})
    assert "\n" not in str(refused.value)
    assert engine.state()["faults"] == []
    with pytest.raises(Refused, match=re.escape(why)):
        VirtualEngine(replace(WALLED, overrides=(*WALLED.overrides, f"faults=['goal {goal} at 3 s']")))
    with pytest.raises(Refused, match=re.escape(why)):
        VirtualEngine(replace(WALLED, faults=(f"goal {goal} at 3 s",)))


def test_a_goal_on_an_obstacle_that_was_set_down_is_refused() -> None:
    engine = VirtualEngine(WALLED)
    engine.obey({"do": "fault", "text": "obstacle 4,4.5,0.5"})
    for _ in range(2):
        engine.obey({"do": "step"})
    with pytest.raises(Refused, match="an obstacle was set down there"):
        engine.obey({"do": "fault", "text": "goal 4.2,4.5"})


def test_a_run_with_another_goal_ends_there() -> None:
    engine = clicked(Setting("straight", overrides=("time_limit_s=60.0",)), {2.0: ["goal 3,2"]})
    assert engine.state()["over"] == "goal_reached"
    x, y = engine.pictures[0].where(1) or (0.0, 0.0)
    assert hypot(x - 3.0, y - 2.0) < 0.15


def test_many_robots_are_computed_at_lower_rates_that_are_part_of_the_link(capfd: pytest.CaptureFixture[str]) -> None:
    few = Setting("straight", robots=16)
    assert lighter(few) == few
    many = lighter(Setting("straight", robots=50, overrides=("world.lidar.beams=180",)))
    assert many.overrides == ("world.lidar.beams=180", "mission.control_hz=20")
    assert "50 robots: computed with mission.control_hz=20" in capfd.readouterr().err
    assert setting_of(fragment_of(many)) == many
    assert lighter(many) == many
    lower = ("mission.control_hz=10", "world.lidar.beams=0")
    assert lighter(Setting("straight", robots=50, overrides=lower)).overrides == lower
