"""`lfa validate` says `ok` in a line, or every mistake of the file, each with its line."""

from __future__ import annotations

import sys
from pathlib import Path

import msgspec
import pytest

from lfa.deploy import cli
from lfa.deploy.command_line import run_cli

#      line                                        key and what is said; None: nothing is wrong here
SCENARIO = (
    ('title = "a course"',                         None),
    ('time_limit_s = 0.1',                         "time_limit_s = 0.1: must be a number from 1 to"),
    ('colour = "red"',                             "colour = red: no such key: known are title"),
    ('faults = [',                                 None),
    ('  "kill 2 at 5 s",',                         None),
    ('  "kill 7 at 5 s",',                         "faults[1] = 'kill 7 at 5 s': no robot '7'"),
    (']',                                          None),
    ('[mission]',                                  None),
    ('robots = [1, 2, 3]',                         None),
    ('profile = "slow"',                           "mission.profile = slow: must be one of fast, std, wifi, auto"),
    ('can_lead = [4]',                             "mission.can_lead = [4]: must be a non-empty part of"),
    ('[mission.following]',                        None),
    ('controller = "pid"',                         "mission.following.controller = pid: must be one of"),
    ('[mission.leading]',                          None),
    ('route_m = [[4, 0], [9, 0]]',                 None),
    ('crusie_mps = 0.3',                           "mission.leading.crusie_mps = 0.3: no such key: did you mean"),
    ('[world]',                                    None),
    ('walls_m = [',                                None),
    ('  [1, 1, 1, 1],',                            "world.walls_m[0] = [1.0, 1.0, 1.0, 1.0]: must be two different"),
    ('  [5, 5, 6, "x"],',                          "world.walls_m[1][3] = x: must be a number, not text"),
    (']',                                          None),
    ('[world.lidar]',                              None),
    ('beams = "many"',                             "world.lidar.beams = many: must be a whole number, not text"),
    ('[[world.obstacles]]',                        None),
    ('center_m = [2, 9]',                          None),
    ('radius_m = -3',                              "world.obstacles[0].radius_m = -3.0: must be a number from 0.01"),
    ('[[world.obstacles]]',                        "world.obstacles[1].center_m is missing: must be given"),
    ('radius_m = 0.5',                             None),
    ('[restart]',                                  None),
    ('robt2 = "never"',                            "restart.robt2 = never: no such process: did you mean 'robot2'?"),
)  # fmt: skip


def _validate(monkeypatch: pytest.MonkeyPatch, *words: str) -> int:
    monkeypatch.setattr(sys, "argv", ["lfa", "validate", *words])
    return run_cli("lfa", cli.build(["validate"]))


@pytest.fixture
def wrong(tmp_path: Path) -> Path:
    path = tmp_path / "course.toml"
    path.write_text("\n".join(line for line, _ in SCENARIO))
    return path


def test_every_mistake_of_a_scenario_is_a_line_that_says_where_it_stands(
    wrong: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert _validate(monkeypatch, str(wrong)) == 2
    said = capsys.readouterr()
    expected = [f"lfa: {wrong}:{n}: {says}" for n, (_, says) in enumerate(SCENARIO, start=1) if says]
    assert not said.out
    for line, start in zip(said.err.splitlines(), expected, strict=True):
        assert line.startswith(start)


def test_with_json_the_mistakes_are_json_too(
    wrong: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert _validate(monkeypatch, str(wrong), "--json") == 2
    errors = msgspec.json.decode(capsys.readouterr().out)["errors"]
    lines = [n for n, (_, says) in enumerate(SCENARIO, start=1) if says]
    assert [(error["file"], error["line"]) for error in errors] == [(str(wrong), line) for line in lines]
    assert errors[-1]["key"] == "restart.robt2"


@pytest.mark.parametrize(
    ("words", "text"),
    [(("paper_path1", "--seed", "many"), "--seed"), (("papr_path1",), "did you mean 'paper_path1'?")],
)
def test_other_refusals_are_json_with_json(
    words: tuple[str, ...], text: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert _validate(monkeypatch, *words, "--json") == 2
    (error,) = msgspec.json.decode(capsys.readouterr().out)["errors"]
    assert text in error["text"]


def test_a_value_from_the_command_line_has_no_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert _validate(monkeypatch, "straight", "--set", "radio.loss=2", "--set", "world.lidar.beams=1") == 2
    assert capsys.readouterr().err.splitlines() == [
        "lfa: straight.toml with --set: world.lidar.beams = 1: must be a number from 4 to 4096, or 0 for robots "
        "without a scanner",
        "lfa: straight.toml with --set: radio.loss = 2.0: must be a number from 0 to 1",
    ]


def test_a_syntax_error_has_its_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "broken.toml"
    path.write_text("title = 'x'\n\ntime_limit_s = \n")
    assert _validate(monkeypatch, str(path)) == 2
    assert capsys.readouterr().err.startswith(f"lfa: {path}:3: no TOML (Invalid value): must be a scenario file")


@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("paper_path1", "paper_path1: ok, 4 robots, at most 240 s"),
        ("deploy/fleet.example.toml", "deploy/fleet.example.toml: ok, fleet example of 4 robots on 1 machine"),
    ],
)
def test_a_right_file_is_one_line(
    name: str, line: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert _validate(monkeypatch, name) == 0
    assert capsys.readouterr().out == f"{line}\n"


def test_show_prints_a_scenario_that_can_be_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert _validate(monkeypatch, "paper_path1", "--seed", "3", "--show") == 0
    drawn = tmp_path / "drawn.toml"
    drawn.write_text(capsys.readouterr().out)
    assert _validate(monkeypatch, str(drawn)) == 0
