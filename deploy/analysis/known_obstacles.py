"""Static obstacles that the robots of a run reported to each other: the known obstacles of iteration 2."""

from __future__ import annotations

from math import hypot
from pathlib import Path

from lfa.deploy.recording import mcap_reader
from lfa.protocol.errors import Refused
from lfa.protocol.mission import KNOWN_MAX
from lfa.protocol.topics import TOPIC

STANDING = ("stationary", "pothole", "trap")
STILL_MPS = 0.05
"""Maximum reported speed [m/s] of a static obstacle."""
SAME_M = 0.4
"""Distance [m] below which two reports are of the same obstacle."""
MATE_M = 0.5
"""Distance [m] to another robot's reported position below which the reported obstacle is that robot."""
TOLD_MIN = 2
"""Minimum number of reports of an obstacle; a single report may be noise."""

Circle = tuple[float, float, float]
"""Position x, y and radius [m] in `map`."""


def known_obstacles(folder: Path) -> tuple[Circle, ...]:
    """Return x, y, radius [m] in `map` of at most `KNOWN_MAX` static obstacles. Raises Refused if no run folder."""
    if not (folder / "recording.mcap").is_file():
        raise Refused(f"--map-from {folder}: no run folder, it has no recording.mcap")
    places: dict[str, tuple[float, float]] = {}
    found: list[list[Circle]] = []
    for owner, topic, _, message in mcap_reader.messages(folder, frozenset({"pose", "obstacles"})):
        if topic == TOPIC["pose"].name:
            places[owner] = message.x, message.y
            continue
        moves = hypot(*message.twist_map) > STILL_MPS
        mate = any(hypot(message.x - x, message.y - y) < MATE_M for robot, (x, y) in places.items() if robot != owner)
        if message.kind in STANDING and not moves and (not mate or message.kind == "trap"):
            _take(found, (message.x, message.y, message.radius_m), alone=message.kind == "trap")
    known = [_middle(seen) for seen in found if len(seen) >= TOLD_MIN]
    return tuple(sorted(known)[:KNOWN_MAX])


def _take(found: list[list[Circle]], one: Circle, *, alone: bool) -> None:
    """Add `one` to the reports of the same obstacle; with `alone` a single report counts as `TOLD_MIN` reports."""
    for seen in found:
        x, y, _ = _middle(seen)
        if hypot(one[0] - x, one[1] - y) < SAME_M:
            seen.append(one)
            return
    found.append([one] * (TOLD_MIN if alone else 1))


def _middle(seen: list[Circle]) -> Circle:
    """Return the mean position of all reports, with the largest radius."""
    many = len(seen)
    x, y = sum(one[0] for one in seen) / many, sum(one[1] for one in seen) / many
    return round(x, 3), round(y, 3), round(max(one[2] for one in seen), 3)
