"""Types of `summary.json`, the results of a run; fields may be added, but not renamed."""

from __future__ import annotations

from pathlib import Path

import msgspec
from msgspec import Struct

from lfa.deploy.recording.event_log import Failover, FaultDone, LeaderTerm, TermViolation
from lfa.deploy.recording.provenance import Provenance
from lfa.deploy.recording.recorder import Recording
from lfa.protocol.errors import Refused
from lfa.protocol.file_reading import DamagedFile, read_json
from lfa.world.description.load import Outcome

SUMMARY = "summary.json"
ENDED_WELL = ("goal_reached", "time_limit", "recorded")


class RobotSummary(Struct, kw_only=True):
    """Results of one robot.

    Errors are those of a follower, None for a robot that never followed or never settled. Rms values cover the time
    from `settled_after_s` on, without avoidance and formation changes (`excused_s` in total).
    """

    id: int
    alive: bool
    role_at_end: str
    final_pose: tuple[float, float, float, float] | None
    """Position x, y, z [m] and heading theta [rad] in `map`."""
    final_speed_mps: float | None
    distance_error_rms_m: float | None = None
    distance_error_max_m: float | None = None
    """Largest magnitude [m] after settling, with nothing left out."""
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
    way_m: float | None = None
    """Way driven [m]; None for a robot that was not seen."""
    mean_speed_mps: float | None = None
    """Mean speed [m/s] from its start to its last motion; None for a robot that did not drive."""
    least_clearance_m: float | None = None
    """Least distance [m] from its body to a wall, an obstacle or another robot's body; None in an empty world."""


class Overload(Struct, kw_only=True):
    """Signs that the machine did not keep up with a run."""

    stood_still_s: float
    """Time [s] for which the world's time stood still, because its process came too late."""
    late_s: dict[str, float]
    """Largest lateness [s] of each robot's loop, or the world's, that was late for seconds, by its name."""
    slow_hz: dict[str, float] = {}
    """Lowest control rate [Hz] of each robot that its machine kept late: usual if it sent fewer rows only."""


class Summary(Struct, kw_only=True):
    """Results of one run."""

    scenario: str
    mode: str
    """Execution of the run: `processes` or `simulated`."""
    seed: int
    outcome: Outcome
    reason: str | None
    duration_s: float
    """Wall-clock duration [s] of the run itself."""
    sim_duration_s: float
    real_time_factor: float
    arrived_at_s: float | None = None
    """Time [s] at which the leader arrived at the goal; None when none did."""
    robots: list[RobotSummary]
    left_behind: list[int] = []
    """Robots alive at the end, but not in the chain or farther from their predecessor than told by `LEFT_BEHIND_M`."""
    leaders: list[LeaderTerm]
    failovers: list[Failover]
    faults: list[FaultDone]
    assertions: list[Assertion]
    violations: list[TermViolation]
    provenance: Provenance | None = None
    """What made the run; None in runs of versions that did not say."""
    recording: Recording | None = None
    """Counts of the recorder; None when the recorder died before it wrote them."""
    overload: Overload | None = None
    """None for a run that its machine kept up with, and for simulated ones."""
    warnings: list[str] = []
    """What the results may lack: holes in the recording that they were computed from."""

    @property
    def exit_code(self) -> int:
        """Return 0 if the run ended at the goal or the time limit with all assertions ok, else 1.

        Reaching the goal with nobody left behind is an assertion by default.
        """
        return 0 if self.outcome in ENDED_WELL and all(a.ok for a in self.assertions) else 1


def write(folder: Path, summary: Summary) -> None:
    """Write the summary atomically: on a full disk the old file stays."""
    fresh = (folder / SUMMARY).with_suffix(".new")
    try:
        fresh.write_bytes(msgspec.json.format(msgspec.json.encode(summary), indent=1) + b"\n")
        fresh.replace(folder / SUMMARY)
    finally:
        fresh.unlink(missing_ok=True)


def read(folder: Path) -> Summary:
    """Return the summary of a run. Raises FileNotFoundError if there is none, Refused if it is of another version."""
    try:
        return read_json(folder / SUMMARY, Summary)
    except DamagedFile as error:
        raise Refused(
            f"{folder / SUMMARY}: of another version or damaged ({error}): read it with the lfa of its time"
        ) from None
    except FileNotFoundError:
        raise
    except OSError as error:
        raise Refused(f"{folder / SUMMARY}: cannot be read ({error.strerror}): must be a file that lfa wrote") from None


class Assertion(Struct):
    """Result of one assertion about a run."""

    name: str
    ok: bool
    text: str = ""
    """Measured and required value, with units."""
