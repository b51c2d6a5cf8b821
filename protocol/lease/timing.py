"""Durations of the lease protocol: the three profiles of lease.md 3.4, and the values derived from them.

Only the numbers of the table are constants. `T_grant` follows from them: the leader counts its lease from before
its request, a voter from the request's arrival, on clocks whose rates differ by at most `CLOCK_RATE_ERROR` either
way, and a leader's last command moves its robot for one more deadman.
"""

from __future__ import annotations

from math import ceil

from msgspec import Struct

from lfa.protocol.mission import CONTROL_HZ, Mission, Profile

CLOCK_RATE_ERROR = 1e-3
"""Maximum rate error eps of a monotonic clock (rate within 1 +- eps); oscillators and NTP slewing stay below half."""
CONTROL_PERIOD_S = 1.0 / CONTROL_HZ
DEADMAN_PERIODS_MIN = 3


class Timing(Struct, frozen=True):
    """Durations [s] of one profile, each on its user's own clock."""

    heartbeat_s: float
    """Heartbeat h [s]: interval between two PROPOSEs of a leader."""
    act_s: float
    """Lease duration T_act [s], counted from the sending of the PROPOSE that a quorum granted."""
    deadman_s: float
    """Deadman D [s]: a gateway brakes after D without a command, and refuses commands computed longer ago."""
    rank_step_s: float
    """Delay delta [s] of each candidate after the one before it."""
    chain_silence_s: float
    """Silence t_chain [s] after which a leader removes a robot from the chain."""
    remove_silence_s: float
    """Silence t_remove [s] after which a leader removes a voter."""

    @property
    def grant_s(self) -> float:
        """Bond duration T_grant [s] of a voter: (T_act + D)(1+eps)/(1-eps), rounded up to the next millisecond."""
        slowest = (1.0 + CLOCK_RATE_ERROR) / (1.0 - CLOCK_RATE_ERROR)
        return ceil((self.act_s + self.deadman_s) * slowest * 1000.0) / 1000.0


#                          heartbeat act    deadman rank   chain  remove
_PROFILES: dict[Profile, tuple[float, float, float, float, float, float]] = {
    "fast":               (0.020,    0.100, 0.040,  0.006, 0.320, 0.640),
    "std":                (0.040,    0.240, 0.060,  0.010, 0.640, 1.200),
    "wifi":               (0.100,    0.800, 0.200,  0.030, 1.600, 3.000),
}  # fmt: skip


def timing_of(profile: Profile, control_hz: float = CONTROL_HZ) -> Timing:
    """Return the durations of a profile; the deadman is never shorter than three control periods at `control_hz`."""
    heartbeat_s, act_s, deadman_s, rank_step_s, chain_silence_s, remove_silence_s = _PROFILES[profile]
    deadman_s = max(deadman_s, DEADMAN_PERIODS_MIN / control_hz)
    return Timing(heartbeat_s, act_s, deadman_s, rank_step_s, chain_silence_s, remove_silence_s)


def timing_for(mission: Mission) -> Timing:
    """Return the durations that all processes of a mission keep."""
    return timing_of(mission.profile, mission.control_hz)
