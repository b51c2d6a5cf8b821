"""Files of other programs and of other machines, under 500 seeded mutations: a value or one line, in bounds.

Those of `lfa` itself are in `test_damaged_files.py`.
"""

from __future__ import annotations

import io
import tarfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from random import Random

import msgspec
import numpy as np
import pytest
from PIL import Image

from lfa.agents.following.onnx_policy import FIELDS, OUTPUTS, OnnxModel
from lfa.deploy.campaign.combine import combine
from lfa.deploy.campaign.folder import Campaign, StoredResult
from lfa.deploy.campaign.sweep.plan import read_plan
from lfa.deploy.fleet.remote import journals
from lfa.deploy.robot.ros_presets import load_preset
from lfa.deploy.ros import bag
from lfa.deploy.version import code_line
from lfa.deploy.worlds.import_command import read_world
from lfa.world.description import maps
from lfa.world.description.load import Scenario, shipped
from lfa.world.description.recorded_leader import with_leader
from tests.agents.following.test_onnx_policy import model
from tests.test_damaged_files import MUTATIONS, Format, _mutated, _outcome, _recording

TEXTS = {
    "world (SDF)": (
        "w.sdf",
        '<sdf version="1.9"><world name="w"><model name="m"><pose>1 2 0 0 0 0.3</pose><link name="l">'
        '<collision name="c"><geometry><box><size>1 2 1</size></box></geometry></collision></link></model></world>'
        "</sdf>",
    ),
    "drawing (SVG)": (
        "w.svg",
        '<svg width="9" height="9"><g transform="translate(1,2) rotate(30)"><rect x="1" y="1" width="2" height="3"/>'
        '<path d="M 1 1 L 2 2 A 1 2 0 0 1 4 4 C 1 1 2 2 3 3 Z"/><circle cx="4" cy="4" r="1"/></g></svg>',
    ),
    "map (MovingAI)": ("w.map", "type octile\nheight 3\nwidth 4\nmap\n..@.\n.@@.\n....\n"),
    "world (IR-SIM)": (
        "w.yaml",
        "world: {height: 9, width: 9}\nrobot: {state: [1, 1, 0], goal: [8, 8, 0]}\n"
        "obstacle:\n  - {number: 2, shape: {name: circle, radius: 0.5}, state: [[3, 3, 0], [5, 5, 0]]}\n",
    ),
    "robot (TOML)": ("r.toml", 'odom = "odom"\nscan = "scan"\ncmd_vel = "cmd_vel"\n'),
    "plan of a campaign (TOML)": (
        "p.toml",
        'scenario = "straight"\nseeds = "1..3"\nrobots = 2\n[set]\ntime_limit_s = 2\n',
    ),
    "recorded leader (text)": ("l.dat", "".join(f"{t}.0 {t * 0.4} {t * 0.1} 0.0\n" for t in range(20))),
}
READERS: dict[str, Callable[[Path], object]] = {
    "robot (TOML)": lambda path: load_preset(str(path)),
    "plan of a campaign (TOML)": read_plan,
    "recorded leader (text)": lambda path: with_leader(_straight(), str(path)),
}
"""Readers of TEXTS; the others are worlds."""


@cache
def _straight() -> Scenario:
    return shipped()["straight"]


def _text(name: str) -> Format:
    def make(folder: Path) -> Path:
        path = folder / TEXTS[name][0]
        path.write_text(TEXTS[name][1])
        return path

    return make


def _archive(folder: Path) -> Path:
    with tarfile.open(folder / "a.tar", "w") as packed:
        for name in ("robot1-1.bin", "notes.txt", "robot2-7.bin"):
            member = tarfile.TarInfo(name)
            member.size = 700
            packed.addfile(member, io.BytesIO(bytes(700)))
    return folder / "a.tar"


def _unpack(path: Path) -> object:
    try:
        return journals.unpack(path.read_bytes(), path.parent / "run")
    except tarfile.TarError:  # which the caller tells in one line
        return None


def _campaign(folder: Path) -> Path:
    (folder / "results").mkdir()
    described = Campaign(code_line(), "sweep", "c", "plan", ("a", "b"))
    (folder / "campaign.json").write_bytes(msgspec.json.encode(described))
    stored = StoredResult("a", "plan", code_line(), "", {"outcome": "goal_reached"})
    (folder / "results/a.json").write_bytes(msgspec.json.encode(stored))
    return folder / "campaign.json"


def _result(folder: Path) -> Path:
    return _campaign(folder).parent / "results/a.json"


def _png(folder: Path) -> Path:
    Image.fromarray(np.arange(64, dtype=np.uint8).reshape(8, 8)).save(folder / "map.png")
    (folder / "map.yaml").write_text(
        "image: map.png\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.2\n"
    )
    return folder / "map.png"


def _onnx(folder: Path) -> Path:
    return Path(model(folder / "m.onnx", np.zeros((len(FIELDS), OUTPUTS), np.float32)))


FORMATS: dict[str, tuple[Format, Callable[[Path], object]]] = {
    **{name: (_text(name), READERS.get(name, read_world)) for name in TEXTS},
    "archive of journals (tar)": (_archive, _unpack),
    "campaign (JSON)": (_campaign, lambda path: combine([path.parent])),
    "result of a campaign (JSON)": (_result, lambda path: combine([path.parent.parent])),
    "image of a map (PNG)": (_png, lambda path: maps.read(path.with_suffix(".yaml"))),
    "controller (ONNX)": (_onnx, lambda path: OnnxModel(path, "m")),
    "recording for a bag (MCAP)": (_recording, lambda path: list(bag.mapped(path.parent))),
}


@pytest.mark.parametrize("name", FORMATS)
def test_a_damaged_file_of_others_is_a_value_or_one_line(name: str, tmp_path: Path) -> None:
    make, read = FORMATS[name]
    path = make(tmp_path)
    good = path.read_bytes()
    assert _outcome(read, path) == ""
    for seed in range(MUTATIONS):
        path.write_bytes(_mutated(good, Random(seed)))
        said = _outcome(read, path)
        assert "\n" not in said, f"{name}, seed {seed}: {said}"
