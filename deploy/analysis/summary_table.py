"""Formatting of a summary as a few lines for a terminal."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path

from lfa.deploy.analysis.summary import RobotSummary, Summary

HEADINGS = (
    "robot",
    "at the end",
    "distance error rms",
    "max",
    "bearing rms",
    "heading rms",
    "settled",
    "contacts",
    "met",
)


def text(summary: Summary, folder: Path) -> str:
    reason = "" if summary.reason is None else f" ({summary.reason})"
    rows = [HEADINGS, *(_row(robot) for robot in summary.robots)]
    return "\n".join(
        [
            f"{summary.scenario}, {summary.mode}, seed {summary.seed}: {summary.outcome}{reason}",
            f"  {summary.sim_duration_s:.1f} s in {summary.duration_s:.1f} s, {summary.real_time_factor:g} x real time",
            *(f"  {line}" for line in _aligned(rows)),
            *(f"  {line}" for line in _leaders(summary)),
            *([f"  left behind: robot {', '.join(map(str, summary.left_behind))}"] if summary.left_behind else []),
            *(f"  not ok: {a.name} {a.text}".rstrip() for a in summary.assertions if not a.ok),
            *(f"  violation of {v.invariant} at {v.at_s:.3f} s: {v.text}" for v in summary.violations),
            *(f"  warning: {warning}" for warning in summary.warnings),
            f"see it: {lfa()} view {folder}",
            f"more: {lfa()} report {folder} (a page for a browser)",
            f"run folder: {folder}{', with holes in its recording' if summary.warnings else ''}",
        ]
    )


def lfa() -> str:
    """Return the command to type: `lfa` if it is on the PATH, else the relative path of the called program."""
    return "lfa" if shutil.which("lfa") or not sys.argv[0].endswith("lfa") else os.path.relpath(sys.argv[0])


def _row(robot: RobotSummary) -> tuple[str, ...]:
    met = ", ".join(f"{count} {kind}" for kind, count in robot.obstacles_met.items() if count)
    return (
        str(robot.id),
        robot.role_at_end if robot.alive else "gone",
        _scaled(robot.distance_error_rms_m, 1000.0, "mm"),
        _scaled(robot.distance_error_max_m, 1000.0, "mm"),
        _scaled(robot.bearing_error_rms_rad, 57.2958, "deg"),
        _scaled(robot.heading_error_rms_rad, 57.2958, "deg"),
        _scaled(robot.settled_after_s, 1.0, "s"),
        str(robot.contacts),
        met or "-",
    )


def _leaders(summary: Summary) -> list[str]:
    lines = [f"robot {r.robot_id} led from {r.from_s:.2f} s (term {r.term[0]}, {r.cause})" for r in summary.leaders]
    for f in summary.failovers:
        took = f"{f.first_command_ms:.0f} ms" if f.first_command_ms is not None else "never"
        lines.append(f"{f.cause} of leader {f.victim} at {f.at_s:.2f} s: next leader's first command after {took}")
    return lines


def _scaled(value: float | None, factor: float, unit: str) -> str:
    return "-" if value is None else f"{value * factor:.2f} {unit}"


def _aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    widths = [max(len(cell) for cell in column) for column in zip(*rows, strict=True)]
    return ["  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True)) for row in rows]
