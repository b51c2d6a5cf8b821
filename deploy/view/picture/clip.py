"""Clip of a recording: the frames and news of a run folder, to be played without a server.

A clip has ten frames a second, fewer of a run that is longer than `FRAMES_MAX` of them.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from msgspec import Struct

from lfa.deploy.recording.mcap_reader import look_into, messages
from lfa.deploy.recording.run_folder import scenario_of
from lfa.deploy.view.picture.ground import ground_of
from lfa.deploy.view.picture.picture import TOPICS, Picture
from lfa.protocol.errors import Refused

FRAME_S = 0.1
FRAMES_MAX = 6000
TILES_EVERY_S = 2.0
"""Period [s] of the tiles of an explorer's map: each is larger than all else of a frame."""
MARKED = ("lead", "contact", "fault", "died", "decision", "failed")
"""What is marked on the time line."""


class _Pane(Struct):
    """Frames and news of one run."""

    frames: list[dict[str, Any]] = []
    news: list[dict[str, Any]] = []
    every_s: float = FRAME_S


def clip_of(folders: list[Path]) -> dict[str, Any]:
    """Return the clip of one run, or of two on one clock. Raises Refused for a folder without a readable recording."""
    if len(folders) > 2:
        raise Refused(f"{len(folders)} runs: must be one, or two side by side")
    for folder in folders:
        look_into(folder)
    scenarios = [scenario_of(folder) for folder in folders]
    panes = [_pane(folder, scenario.mission.robots) for folder, scenario in zip(folders, scenarios, strict=True)]
    labels = [folder.resolve().name for folder in folders] if len(folders) > 1 else [""]
    scene = {
        "engine": "recording",
        "title": " / ".join(scenario.title for scenario in scenarios),
        "panes": [ground_of(scenario, label) for scenario, label in zip(scenarios, labels, strict=True)],
        "marks": [mark for pane in panes for mark in _marks(pane)],
    }
    return {"scene": scene, "panes": [{"frames": pane.frames, "news": pane.news} for pane in panes]}


def _pane(folder: Path, robots: tuple[int, ...]) -> _Pane:
    picture, pane = Picture(robots), _Pane()
    sent, tiles_at, next_s = 0, 0.0, 0.0
    tiles: dict[tuple[float, float], dict[str, Any]] = {}
    for owner, topic, t, message in messages(folder, TOPICS - {"scan"}):
        picture.see(t, owner, topic, message)
        if t < next_s or not (frame := picture.frame())["robots"]:
            continue
        next_s = t + pane.every_s
        pane.frames.append(frame)
        for item in picture.news.since(sent):
            if item["k"] == "tile":
                tiles[item["x"], item["y"]] = item
            else:
                pane.news.append({**item, "at": frame["t"]})
        sent = picture.news.count
        if t >= tiles_at:
            tiles_at = t + TILES_EVERY_S
            pane.news += [{**tile, "at": frame["t"]} for tile in tiles.values()]
            tiles.clear()
        if len(pane.frames) > FRAMES_MAX:
            pane.frames, pane.every_s = pane.frames[::2], 2.0 * pane.every_s
    if not pane.frames:
        raise Refused(f"{folder}: no robot has a position in this recording")
    last = {"at": pane.frames[-1]["t"]}
    pane.news += [{**item, **last} for item in picture.news.since(sent) if item["k"] != "tile"]
    pane.news += [{**tile, **last} for tile in tiles.values()]
    return pane


def _marks(pane: _Pane) -> list[list[Any]]:
    """Return time [s] and kind of what the time line marks."""
    kinds = ((item["at"], item.get("kind", item["k"])) for item in pane.news)
    return [[at_s, kind] for at_s, kind in kinds if kind in MARKED]
