"""The trajectory of a recorded robot as that of a scenario's leader: from a rosbag, or from MRCLAM text files.

MRCLAM (UTIAS Multi-Robot Cooperative Localization and Mapping): `RobotN_Groundtruth.dat`, lines `time x y orientation`.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from math import atan2, hypot, isfinite
from pathlib import Path
from typing import Any

from msgspec import structs

from lfa.protocol.errors import Refused
from lfa.protocol.file_reading import DamagedFile, read_text
from lfa.protocol.geometry import Pose2D, between, compose
from lfa.world.description.placement import starts_of
from lfa.world.description.scenario import Scenario

STEP_M, STEP_S = 0.25, 0.5
"""Least distance and time between two way-points: a recording has fifty poses a second."""
POINTS_MAX = 20_000
RESERVE = 1.05
"""Cruise speed as a multiple of the fastest leg."""
TEXT_BYTES_MAX = 64 * 1024 * 1024
TYPES = ("nav_msgs/msg/Odometry", "geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/PoseWithCovarianceStamped")
Timed = tuple[float, float, float]
"""Time [s], x, y [m]."""


def with_leader(scenario: Scenario, recording: str) -> Scenario:
    """Return `scenario` whose leader drives as the robot in `recording`: FILE.dat, a bag's folder, or FOLDER:TOPIC.

    The recorded motion begins where the scenario's leader starts, in its heading. Raises Refused.
    """
    timed = thinned(_poses(recording))
    if len(timed) < 2:
        raise Refused(
            f"--leader-from {recording}: the robot in it moves less than {STEP_M:g} m: must be a moving robot"
        )
    t0, x0, y0 = timed[0]
    heading = atan2(timed[1][2] - y0, timed[1][1] - x0)
    start = starts_of(scenario)[0]
    route = []
    for _, x, y in timed:
        place = compose(start, between(Pose2D(x0, y0, heading), Pose2D(x, y)))
        route.append((place.x, place.y))
    times = tuple(t - t0 for t, _, _ in timed)
    fastest_mps = max(hypot(c - a, d - b) / (u - t) for (t, a, b), (u, c, d) in pairwise(timed))
    leading = structs.replace(
        scenario.mission.leading, motion="trajectory", route_m=tuple(route), times_s=times, orientations=(), known_m=(),
        cruise_mps=max(scenario.mission.leading.cruise_mps, RESERVE * fastest_mps),
    )  # fmt: skip
    mission = structs.replace(scenario.mission, leading=leading)
    return structs.replace(scenario, mission=mission, time_limit_s=max(scenario.time_limit_s, 1.5 * times[-1] + 30.0))


def thinned(timed: Iterator[Timed]) -> list[Timed]:
    """Return the poses that are STEP_M and STEP_S apart; those with numbers that are not finite are left out."""
    kept: list[Timed] = []
    for t, x, y in timed:
        if not (isfinite(t) and isfinite(x) and isfinite(y)):
            continue
        if kept and (t - kept[-1][0] < STEP_S or hypot(x - kept[-1][1], y - kept[-1][2]) < STEP_M):
            continue
        kept.append((t, x, y))
        if len(kept) >= POINTS_MAX:
            break
    return kept


def _poses(recording: str) -> Iterator[Timed]:
    return _mrclam(Path(recording)) if recording.endswith((".dat", ".txt")) else _bag(recording)


def _mrclam(path: Path) -> Iterator[Timed]:
    try:
        text = read_text(path, TEXT_BYTES_MAX)
    except OSError as error:
        raise Refused(f"--leader-from {path}: {error.strerror}: must be a text file or the folder of a bag") from None
    except DamagedFile as error:
        raise Refused(f"--leader-from {path}: {error}: must be lines 'time x y orientation'") from None
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.partition("#")[0].split()
        if not words:
            continue
        try:
            t, x, y = (float(word) for word in words[:3])
        except ValueError:
            raise Refused(f"--leader-from {path}: line {number}: must be 'time x y orientation'") from None
        yield t, x, y


def _bag(recording: str) -> Iterator[Timed]:
    try:
        from rosbags.highlevel import AnyReader, AnyReaderError  # only who reads a bag needs it
    except ModuleNotFoundError:
        raise Refused("--leader-from a bag needs rosbags: install with: pip install 'lfa[ros]'") from None

    folder, _, topic = recording.partition(":")
    try:
        with AnyReader([Path(folder)]) as reader:
            fitting = [one for one in reader.connections if one.msgtype in TYPES and topic in ("", one.topic)]
            if not fitting:
                topics = ", ".join(sorted({one.topic for one in reader.connections if one.msgtype in TYPES})) or "none"
                raise Refused(f"--leader-from {recording}: topics with poses: {topics}; say FOLDER:TOPIC")
            for connection, at_ns, raw in reader.messages(fitting[:1]):
                yield (1e-9 * at_ns, *_place(reader.deserialize(raw, connection.msgtype)))
    except (AnyReaderError, OSError, ValueError, AssertionError) as error:
        raise Refused(f"--leader-from {folder}: {error}: must be the folder of a rosbag2, or FILE.dat") from None


def _place(message: Any) -> tuple[float, float]:
    pose = message.pose.pose if hasattr(message.pose, "pose") else message.pose
    return float(pose.position.x), float(pose.position.y)
