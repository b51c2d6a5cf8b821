"""A clip as a film without a browser: a GIF, drawn with pillow, or an MP4 where ffmpeg is installed."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator
from contextlib import suppress
from math import cos, sin
from pathlib import Path
from typing import Any

from PIL import Image, ImageDraw, ImageFont

from lfa.deploy.robot_colours import as_hex, robot_colour
from lfa.deploy.view.picture.picture import COLUMNS
from lfa.protocol.errors import Refused

WIDTH, HEIGHT_MIN, HEIGHT_MAX, FOOT = 720, 240, 540, 34
FINER = 2
"""Pixels drawn for each pixel of the film, along each axis: edges are smooth."""
RATE_HZ = 15
GIF_FRAMES_MAX, MP4_FRAMES_MAX = 180, 6000
TRAIL_FRAMES = 120
MARGIN_M = 1.0
PAPER, INK, SOFT, WALL, STONE = "#ffffff", "#1b1f24", "#9aa6b2", "#39424c", "#6b7681"
GOAL, WAITING, STOPPED = "#1b1f24", "#7b8591", "#c23b12"
RINGS = {"waiting": WAITING, "stopped": STOPPED}
"""Colour of the ring round a robot of a role, which keeps its own colour whatever its role."""

Point = tuple[float, float]


def write_gif(clip: dict[str, Any], path: Path) -> None:
    """Write the first run of a clip as an endless GIF of at most `GIF_FRAMES_MAX` frames."""
    first, *others = [image.quantize(64) for image in _images(clip, GIF_FRAMES_MAX)]
    first.save(path, save_all=True, append_images=others, duration=round(1000 / RATE_HZ), loop=0, optimize=True)


def ffmpeg_for(path: Path) -> str:
    """Return the program that writes an MP4 to `path`. Raises Refused without ffmpeg."""
    program = shutil.which("ffmpeg")
    if program is None:
        raise Refused(f"--mp4 {path}: needs ffmpeg (apt-get install ffmpeg), --gif does without")
    return program


def write_mp4(clip: dict[str, Any], path: Path) -> None:
    """Write the first run of a clip as an MP4 in real time. Raises Refused without ffmpeg."""
    program = ffmpeg_for(path)
    images = _images(clip, MP4_FRAMES_MAX)
    first = next(images)
    form = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{first.width}x{first.height}", "-r", "10", "-i", "-"]
    command = [program, "-y", "-loglevel", "error", *form, "-pix_fmt", "yuv420p", str(path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE) as encoder:
        assert encoder.stdin is not None
        with suppress(BrokenPipeError):  # ffmpeg has ended, and says why
            for image in (first, *images):
                encoder.stdin.write(image.tobytes())
    if encoder.returncode != 0:
        raise Refused(f"--mp4 {path}: ffmpeg ended with {encoder.returncode}")


def _images(clip: dict[str, Any], most: int) -> Iterator[Image.Image]:
    """Yield the frames of the first run, evenly thinned to at most `most`."""
    pane, ground = clip["panes"][0], clip["scene"]["panes"][0]
    frames = pane["frames"]
    step = -(-len(frames) // most)
    camera = _Camera(ground, frames)
    news = [item for item in pane["news"] if item["k"] in ("lead", "obstacle", "route")]
    for n in range(0, len(frames), step):
        yield _image(camera, ground, frames, n, [item for item in news if item["at"] <= frames[n]["t"]])


class _Camera:
    """Transform from metres in `map` to pixels, with all that stands and drives in view."""

    def __init__(self, ground: dict[str, Any], frames: list[dict[str, Any]]) -> None:
        points: list[Point] = [(x, y) for frame in frames for _, x, y, *_ in frame["robots"]]
        points += [tuple(point) for point in ground["route"]]
        points += [(x, y) for x1, y1, x2, y2 in ground["walls"] for x, y in ((x1, y1), (x2, y2))]
        xs, ys = [x for x, _ in points], [y for _, y in points]
        self._left, self._top = min(xs) - MARGIN_M, max(ys) + MARGIN_M
        wide, high = max(xs) - min(xs) + 2 * MARGIN_M, max(ys) - min(ys) + 2 * MARGIN_M
        self.height = 2 * round(min(max(WIDTH * high / wide, HEIGHT_MIN), HEIGHT_MAX) / 2)
        self.scale = FINER * min(WIDTH / wide, self.height / high)
        self._left -= 0.5 * (FINER * WIDTH / self.scale - wide)
        self._top += 0.5 * (FINER * self.height / self.scale - high)

    def at(self, x: float, y: float) -> Point:
        return (x - self._left) * self.scale, (self._top - y) * self.scale

    def circle(self, x: float, y: float, radius: float) -> tuple[float, float, float, float]:
        (px, py), r = self.at(x, y), max(radius * self.scale, 1.0)
        return px - r, py - r, px + r, py + r


def _image(
    camera: _Camera,
    ground: dict[str, Any],
    frames: list[dict[str, Any]],
    n: int,
    news: list[dict[str, Any]],
) -> Image.Image:
    """Draw frame `n`, with what the news up to it say of leaders, routes and obstacles."""
    frame = frames[n]
    image = Image.new("RGB", (FINER * WIDTH, FINER * (camera.height + FOOT)), PAPER)
    pen = ImageDraw.Draw(image)
    routes = [item for item in news if item["k"] == "route"]
    laid = {**ground, **routes[-1]} if routes else ground
    _draw_ground(pen, camera, laid, frame, [item for item in news if item["k"] == "obstacle"])
    colours = robot_colours(ground, frames)
    for row in frame["robots"]:
        past = [place for old in frames[max(0, n - TRAIL_FRAMES) : n + 1] for place in _places(old, row[0])]
        if len(past) > 1:
            pen.line([camera.at(*place) for place in past], fill=SOFT, width=FINER)
    for row in frame["robots"]:
        _draw_robot(pen, camera, dict(zip(COLUMNS, row, strict=True)), ground["radius"], colours[row[0]])
    led = [item for item in news if item["k"] == "lead"]
    who = f"robot {led[-1]['robot']} leads: {led[-1]['why']}" if led else "nobody leads yet"
    font = ImageFont.load_default(13 * FINER)
    pen.text((10 * FINER, FINER * (camera.height + 8)), f"{frame['t']:5.1f} s   {who}", fill=INK, font=font)
    return image.resize((WIDTH, camera.height + FOOT), Image.Resampling.LANCZOS)


def robot_colours(ground: dict[str, Any], frames: list[dict[str, Any]]) -> dict[int, str]:
    """Return the colour of each robot: by its place in the mission, as in every figure; spares come last."""
    seen = {row[0] for frame in frames for row in frame["robots"]}
    robots = [*ground["robots"], *sorted(seen - set(ground["robots"]))]
    return {robot: as_hex(robot_colour(n, len(robots))) for n, robot in enumerate(robots)}


def _places(frame: dict[str, Any], robot: int) -> list[Point]:
    return [(row[1], row[2]) for row in frame["robots"] if row[0] == robot]


def _draw_ground(
    pen: ImageDraw.ImageDraw,
    camera: _Camera,
    ground: dict[str, Any],
    frame: dict[str, Any],
    added: list[dict[str, Any]],
) -> None:
    if len(ground["route"]) > 1:
        pen.line([camera.at(*point) for point in ground["route"]], fill="#d5dae0", width=2 * FINER)
    if ground.get("goal"):
        x, y = ground["goal"]
        pen.ellipse(camera.circle(x, y, 0.2), outline=GOAL, width=2 * FINER)
    for x1, y1, x2, y2 in ground["walls"]:
        pen.line([camera.at(x1, y1), camera.at(x2, y2)], fill=WALL, width=3 * FINER)
    moved = {index: (x, y) for index, x, y in frame.get("moved", [])}
    for index, obstacle in enumerate(ground["obstacles"]):
        x, y = moved.get(index, obstacle["at"])
        pen.polygon([camera.at(x + dx, y + dy) for dx, dy in obstacle["outline"]], fill=STONE)
    for item in added:
        pen.ellipse(camera.circle(item["x"], item["y"], item["radius_m"]), fill=STONE)


def _draw_robot(pen: ImageDraw.ImageDraw, camera: _Camera, robot: dict[str, Any], radius_m: float, colour: str) -> None:
    """Draw a disc: with a frame if it leads, a cross if it is gone, a ring if it waits or is stopped, its heading."""
    x, y, theta, role = robot["x"], robot["y"], robot["theta"], robot["role"]
    radius = max(radius_m, 5.0 * FINER / camera.scale)
    pen.ellipse(camera.circle(x, y, radius), fill=colour)
    if role == "leader":
        pen.rectangle(camera.circle(x, y, 1.5 * radius), outline=colour, width=2 * FINER)
    elif role in RINGS:
        pen.ellipse(camera.circle(x, y, 1.5 * radius), outline=RINGS[role], width=2 * FINER)
    d = 0.5 * radius
    if role == "gone":
        for sign in (1, -1):
            pen.line([camera.at(x - d, y - sign * d), camera.at(x + d, y + sign * d)], fill=PAPER, width=2 * FINER)
        return
    corners = ((0.85 * radius, 0.0), (-d, 0.6 * radius), (-d, -0.6 * radius))
    turned = [(x + cos(theta) * u - sin(theta) * v, y + sin(theta) * u + cos(theta) * v) for u, v in corners]
    pen.polygon([camera.at(*corner) for corner in turned], fill=PAPER)
