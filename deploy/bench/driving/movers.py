"""What moves across a team's way, at 0.03 to 1.5 m/s: kinds of movers, and which contacts count against the team.

Against the team counts each contact with a mover that is no faster than its robots; of a faster one, which no robot
can always escape, only a contact in which the robot drove towards it. The seed draws speeds, places and times.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import atan2, cos
from random import Random

import numpy as np
from msgspec import Struct

from lfa.deploy.bench.driving.course_file import Course
from lfa.deploy.bench.driving.one_run import DrivenRun, complaint, contacts_text
from lfa.deploy.recording import event_log, mcap_reader
from lfa.deploy.recording.event_log import Line
from lfa.deploy.recording.mcap_reader import Array

MOTIONS = ("path_following", "explore")
TOWARDS_MPS = 0.02
"""Speed [m/s] towards the place of a contact above which a robot has driven into it."""
STOPPED_S, STEP_M = 12.0, 0.01
GOAL_M = 12.0


class MoverKind(Struct, frozen=True):
    """Kind of mover: the speeds [m/s] of which the seed takes one, and the obstacles that it gives at that speed."""

    name: str
    speeds_mps: tuple[float, ...]
    draw: Callable[[Random, float], tuple[str, ...]]


def _disc(x: float, y: float, rest: str, radius_m: float = 0.25) -> str:
    return f"{{ center_m = [{x:.3f}, {y:.3f}], radius_m = {radius_m:g}, {rest} }}"


def _steady(x: float, y: float, vx: float, vy: float) -> str:
    return _disc(x, y, f"velocity_mps = [{vx:g}, {vy:g}]")


def head_on(chance: Random, mps: float) -> tuple[str, ...]:
    return (_steady(chance.uniform(6.0, 11.0), chance.uniform(-0.3, 0.3), -mps, 0.0),)


def overtaking(chance: Random, mps: float) -> tuple[str, ...]:
    return (_steady(-chance.uniform(6.0, 10.0), chance.uniform(-0.3, 0.3), mps, 0.0),)


def crossing(chance: Random, mps: float) -> tuple[str, ...]:
    """Return one that crosses the line at about the time at which the team does."""
    side, x = chance.choice((1.0, -1.0)), chance.uniform(3.0, 9.0)
    away_m = mps * (x / 0.4 + chance.uniform(-4.0, 8.0))
    return (_steady(x, side * max(away_m, 0.8), 0.0, -side * mps),)


def stop_and_go(chance: Random, mps: float) -> tuple[str, ...]:
    """Return one that stops for 12 s at the line's edge, on it, and behind it."""
    side, x = chance.choice((1.0, -1.0)), chance.uniform(3.0, 8.0)
    swings = int(STOPPED_S * mps / (2.0 * STEP_M))
    stops = [side * y for y in (1.4, 0.4, -0.6, -1.8, -3.0)]
    points = [f"[{x:.2f}, {y + n % 2 * STEP_M:.2f}]" for y in stops for n in range(2 * swings)]
    return (_disc(x, side * 3.5, f"speed_mps = {mps:g}, waypoints_m = [{', '.join(points)}]"),)


def random_walk(chance: Random, mps: float) -> tuple[str, ...]:
    places = [(x, chance.uniform(-0.8, 0.8)) for x in (3.0, 5.0, 7.0, 9.0)]
    return tuple(_disc(x, y, f"walk_m = 1.2, speed_mps = {mps:g}", 0.2) for x, y in places)


def two_at_once(chance: Random, mps: float) -> tuple[str, ...]:
    return crossing(chance, mps) + head_on(chance, mps)


def another_team(chance: Random, mps: float) -> tuple[str, ...]:
    """Return four bodies one behind the other, 1 m apart, that cross as another team would, and give no way."""
    side, x = chance.choice((1.0, -1.0)), chance.uniform(3.0, 8.0)
    first_m = mps * (x / 0.4 + chance.uniform(-4.0, 2.0))
    return tuple(_steady(x, side * (max(first_m, 1.0) + n), 0.0, -side * mps) for n in range(4))


KINDS = (
    MoverKind("head_on", (0.03, 0.1, 0.3, 0.6, 1.0, 1.5), head_on),
    MoverKind("overtaking", (0.6, 1.0, 1.5), overtaking),
    MoverKind("crossing", (0.03, 0.1, 0.3, 0.6, 1.0, 1.5), crossing),
    MoverKind("stop_and_go", (0.1, 0.3, 0.6), stop_and_go),
    MoverKind("random_walk", (0.2, 0.4), random_walk),
    MoverKind("two_at_once", (0.1, 0.3, 0.6), two_at_once),
    MoverKind("another_team", (0.2, 0.4), another_team),
)


def drawn(kind: MoverKind, seed: int) -> tuple[Course, float]:
    """Return the course with the kind's movers, and their speed [m/s]; the seeds take the speeds in turn."""
    chance = Random(f"{kind.name} {seed}")
    mps = kind.speeds_mps[(seed - 1) % len(kind.speeds_mps)]
    course = Course(((0.0, 0.0), (GOAL_M, 0.0)), obstacles=kind.draw(chance, mps), time_limit_s=150.0)
    return course, mps


def wrong_of(done: DrivenRun, *, faster: bool) -> tuple[str | None, int]:
    """Return what is wrong with a run, and the number of contacts that count against the team.

    `faster`: its movers are faster than its robots.
    """
    counted = sum(robot.contacts for robot in done.summary.robots)
    wrong = complaint(done.summary)
    if not faster or not counted:
        return wrong, counted
    counted = driven_into(event_log.lines(done.folder), mcap_reader.read(done.folder).truth)
    return (None if wrong == contacts_text(done.summary) and not counted else wrong), counted


def driven_into(events: Sequence[Line], truth: Mapping[int, Array]) -> int:
    """Return the number of contacts in which the robot drove towards what it touched.

    `truth` has rows of t [s], x, y [m], theta [rad] and speed [m/s] of each robot.
    """
    count = 0
    for line in event_log.of_kind(events, "contact"):
        rows = truth[line["robot"]]
        before = max(0, int(np.searchsorted(rows[:, 0], line["t"])) - 2)
        _, x, y, theta, mps, *_ = (float(value) for value in rows[before])
        count += mps * cos(atan2(line["y"] - y, line["x"] - x) - theta) > TOWARDS_MPS
    return count
