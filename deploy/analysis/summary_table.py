"""Formatting of a summary as a few lines for a terminal."""

from __future__ import annotations

import os
import shlex
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path

from lfa.deploy.analysis.summary import Overload, RobotSummary, Summary
from lfa.deploy.analysis.tracking_errors import SETTLED_M
from lfa.deploy.client.term_count import TermCount
from lfa.deploy.recording.recorder import RECORDING
from lfa.protocol.topics import WORLD_NAME

HEADINGS = (
    "robot",
    "at the end",
    "distance error rms",
    "max",
    "bearing rms",
    "heading rms",
    "settled",
    "contacts",
    "way",
    "mean speed",
    "clearance",
    "met",
)


def text(summary: Summary, folder: Path | None, *, verbose: bool = False) -> str:
    """Return the lines about a run in `folder`; None if nothing of it was kept. `verbose`: terms as in messages."""
    reason = "" if summary.reason is None else f" ({summary.reason})"
    behind = _named(summary.left_behind)
    if behind and summary.outcome == "goal_reached":
        reason = f" by all but {behind}"
    rows = [HEADINGS, *(_row(robot, left_behind=robot.id in summary.left_behind) for robot in summary.robots)]
    return "\n".join(
        [
            f"{summary.scenario}, {summary.mode}, seed {summary.seed}: {summary.outcome}{reason}",
            f"  {_lasted(summary)}",
            *(f"  {line}" for line in _aligned(rows)),
            *(f"  {line}" for line in _notes(summary)),
            *(f"  {line}" for line in _leaders(summary, verbose)),
            *([f"  left behind: {behind}"] if behind else []),
            *([] if summary.overload is None else [f"  {_overloaded(summary.overload)}"]),
            *(f"  not ok: {a.name} {a.text}".rstrip() for a in summary.assertions if not a.ok),
            *(f"  violation of {v.invariant} at {v.at_s:.3f} s: {v.text}" for v in summary.violations),
            *(f"  warning: {warning}" for warning in summary.warnings),
            *([] if folder is None else _hints(summary, folder)),
        ]
    )


def _lasted(summary: Summary) -> str:
    arrived = "" if summary.arrived_at_s is None else f"; the leader arrived at {summary.arrived_at_s:.1f} s"
    took = f"{summary.sim_duration_s:.1f} s in {summary.duration_s:.1f} s, {summary.real_time_factor:g} x real time"
    if summary.mode == "recorded":
        took = f"recorded for {summary.duration_s:.1f} s, to {summary.sim_duration_s:.1f} s of its time"
    return f"{took}{arrived}"


def _overloaded(overload: Overload) -> str:
    """Return in one line that the machine did not keep up, and by how much."""
    signs = [f"the world stood still for {overload.stood_still_s:.2f} s"] if overload.stood_still_s > 0.0 else []
    robots = {name: late_s for name, late_s in overload.late_s.items() if name != WORLD_NAME}
    if WORLD_NAME in overload.late_s:
        signs.append(f"the world was late by {overload.late_s[WORLD_NAME]:.2f} s")
    if robots:
        worst = max(robots, key=robots.__getitem__)
        who = "1 robot was" if len(robots) == 1 else f"{len(robots)} robots were"
        signs.append(f"{who} late, {worst} by {robots[worst]:.2f} s")
    if overload.slow_hz:
        slowest = min(overload.slow_hz, key=overload.slow_hz.__getitem__)
        who = "1 robot" if len(overload.slow_hz) == 1 else f"{len(overload.slow_hz)} robots"
        signs.append(f"{who} did less to keep time, {slowest} stepped at {overload.slow_hz[slowest]:.3g} Hz")
    return f"this machine did not keep up: {'; '.join(signs)}"


def lfa() -> str:
    """Return the command to type: `lfa` if it is on the PATH, else the path of the called program, quoted."""
    here = shutil.which("lfa") or not sys.argv[0].endswith("lfa")
    return "lfa" if here else shlex.quote(os.path.relpath(sys.argv[0]))


def _hints(summary: Summary, folder: Path) -> list[str]:
    """Return the commands that show more of the run; each can be pasted into a shell."""
    path = shlex.quote(str(folder))
    holes = ", with holes in its recording" if summary.warnings else ""
    if not (folder / RECORDING).is_file():
        return [f"run folder: {path}, without a recording"]
    return [
        f"see it: {lfa()} view {path}",
        f"a page for a browser: {lfa()} report {path}",
        f"run folder: {path}{holes}",
    ]


def _notes(summary: Summary) -> list[str]:
    """Return what the table's numbers cover, and why a follower has none."""
    followers = [robot for robot in summary.robots if robot.final_distance_error_m is not None]
    unsettled = [robot.id for robot in followers if robot.settled_after_s is None]
    notes = (
        ["errors: from when a robot had settled; rms without detours and formation changes, max with them"]
        if any(robot.settled_after_s is not None for robot in followers)
        else []
    )
    if unsettled:
        notes.append(f"settled -: {_named(unsettled)} never kept within {1000.0 * SETTLED_M:.0f} mm of its distance")
    return notes


def _named(robots: Sequence[int]) -> str:
    return f"robot{'s' * (len(robots) > 1)} {', '.join(map(str, robots))}" if robots else ""


def _row(robot: RobotSummary, *, left_behind: bool) -> tuple[str, ...]:
    met = ", ".join(f"{count} {kind}" for kind, count in robot.obstacles_met.items() if count)
    return (
        str(robot.id),
        "gone" if not robot.alive else "left behind" if left_behind else robot.role_at_end,
        _scaled(robot.distance_error_rms_m, 1000.0, "mm"),
        _scaled(robot.distance_error_max_m, 1000.0, "mm"),
        _scaled(robot.bearing_error_rms_rad, 57.2958, "deg"),
        _scaled(robot.heading_error_rms_rad, 57.2958, "deg"),
        _scaled(robot.settled_after_s, 1.0, "s"),
        str(robot.contacts),
        _scaled(robot.way_m, 1.0, "m"),
        _scaled(robot.mean_speed_mps, 1.0, "m/s"),
        _scaled(robot.least_clearance_m, 100.0, "cm"),
        met or "-",
    )


def _leaders(summary: Summary, verbose: bool) -> list[str]:
    terms = TermCount(r.term[0] for r in summary.leaders)
    lines = [
        f"robot {r.robot_id} led from {r.from_s:.2f} s "
        f"(term {r.term[0] if verbose else terms.number(r.term[0])}, {r.cause})"
        for r in summary.leaders
    ]
    for f in summary.failovers:
        took = f"{f.first_command_ms:.0f} ms" if f.first_command_ms is not None else "never"
        lines.append(f"{f.cause} of leader {f.victim} at {f.at_s:.2f} s: next leader's first command after {took}")
    return lines


def _scaled(value: float | None, factor: float, unit: str) -> str:
    return "-" if value is None else f"{value * factor:.{1 if unit == 'mm' else 2}f} {unit}"


def _aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    widths = [max(len(cell) for cell in column) for column in zip(*rows, strict=True)]
    return ["  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True)) for row in rows]
