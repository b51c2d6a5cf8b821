"""`summary.json`: what a run came to. Its shape is these types; fields may be added, none renamed."""

from __future__ import annotations

from pathlib import Path

import msgspec
from msgspec import Struct

from lfa.deploy.recording.event_log import Failover, FaultDone, LeaderTerm, TermViolation
from lfa.deploy.recording.recorder import Recording
from lfa.protocol.errors import Refused
from lfa.world.description.load import Outcome

SUMMARY = "summary.json"
ENDED_WELL = ("goal_reached", "time_limit")


class RobotSummary(Struct, kw_only=True):
    """Errors are a follower's; None where it never followed or never settled. Rms values are taken from
    `settled_after_s` on, with avoidance and formation changes (`excused_s` in all) left out."""

    id: int
    alive: bool
    role_at_end: str
    final_pose: tuple[float, float, float, float] | None
    """x, y, z [m], theta [rad] in `map`."""
    final_speed_mps: float | None
    distance_error_rms_m: float | None = None
    distance_error_max_m: float | None = None
    """Largest magnitude once settled, with nothing left out."""
    bearing_error_rms_rad: float | None = None
    bearing_error_body_rms_rad: float | None = None
    heading_error_rms_rad: float | None = None
    final_distance_error_m: float | None = None
    final_bearing_error_rad: float | None = None
    settled_after_s: float | None = None
    avoidances: int = 0
    formation_changes: int = 0
    excused_s: float = 0.0
    contacts: int
    obstacles_met: dict[str, int]
    orientation_requests: int


class Summary(Struct, kw_only=True):
    scenario: str
    mode: str
    """`processes` or `simulated`."""
    seed: int
    outcome: Outcome
    reason: str | None
    duration_s: float
    """Of the run alone, by the wall clock."""
    sim_duration_s: float
    real_time_factor: float
    robots: list[RobotSummary]
    left_behind: list[int] = []
    """Alive at the end, but out of the chain or more than `LEFT_BEHIND_M` out of place in it."""
    leaders: list[LeaderTerm]
    failovers: list[Failover]
    faults: list[FaultDone]
    assertions: list[Assertion]
    violations: list[TermViolation]
    recording: Recording | None = None
    """None when its recorder died before it could count."""

    @property
    def exit_code(self) -> int:
        """0 only for a run that ended by itself with all assertions ok; the goal is one of them by default."""
        return 0 if self.outcome in ENDED_WELL and all(a.ok for a in self.assertions) else 1


def write(folder: Path, summary: Summary) -> None:
    """All of it or, on a full disk, nothing."""
    fresh = (folder / SUMMARY).with_suffix(".new")
    try:
        fresh.write_bytes(msgspec.json.format(msgspec.json.encode(summary), indent=1) + b"\n")
        fresh.replace(folder / SUMMARY)
    finally:
        fresh.unlink(missing_ok=True)


def read(folder: Path) -> Summary:
    """Raises FileNotFoundError when the run in `folder` has no summary, Refused when it is none of this version's."""
    try:
        return msgspec.json.decode((folder / SUMMARY).read_bytes(), type=Summary)
    except msgspec.DecodeError as error:
        raise Refused(
            f"{folder / SUMMARY}: of another version or damaged ({error}): read it with the lfa of its time"
        ) from None


class Assertion(Struct):
    name: str
    ok: bool
    text: str = ""
    """What was found and what was asked for, with units."""
