"""How long everything lasts: the three profiles of lease.md 3.4, and what follows from them.

Only the numbers of the table are typed. `T_grant` follows from them: the leader counts its lease from before it
asked, a voter from when it was asked, on clocks whose rates differ by at most `CLOCK_RATE_ERROR` either way, and
a leader's last command moves its robot for one deadman more.
"""

from __future__ import annotations

from math import ceil

from msgspec import Struct

from lfa.protocol.mission import Profile

CLOCK_RATE_ERROR = 1e-3
"""eps: a process's monotonic clock runs at a rate within 1 +- this; oscillators and NTP slewing stay below half."""
CONTROL_PERIOD_S = 0.02
DEADMAN_PERIODS_MIN = 3


class Timing(Struct, frozen=True):
    """The durations of one profile [s], each by its holder's own clock."""

    heartbeat_s: float
    """h: between two PROPOSEs of a leader."""
    act_s: float
    """T_act: how long a leader may command, counted from when it sent the PROPOSE that a quorum granted."""
    deadman_s: float
    """D: a gateway brakes after this long without a command, and refuses commands computed longer ago."""
    rank_step_s: float
    """delta: how much later than the one before it each next candidate starts."""
    chain_silence_s: float
    """t_chain: silence after which a leader closes the chain over a robot."""
    remove_silence_s: float
    """t_remove: silence after which a leader drops a voter."""

    @property
    def grant_s(self) -> float:
        """T_grant [s]: how long a voter is bound by a grant. (T_act + D)(1+eps)/(1-eps), up to the next millisecond."""
        slowest = (1.0 + CLOCK_RATE_ERROR) / (1.0 - CLOCK_RATE_ERROR)
        return ceil((self.act_s + self.deadman_s) * slowest * 1000.0) / 1000.0


#                          heartbeat act    deadman rank   chain  remove
_PROFILES: dict[Profile, tuple[float, float, float, float, float, float]] = {
    "fast":               (0.020,    0.100, 0.040,  0.006, 0.320, 0.640),
    "std":                (0.040,    0.240, 0.060,  0.010, 0.640, 1.200),
    "wifi":               (0.100,    0.800, 0.200,  0.030, 1.600, 3.000),
}  # fmt: skip


def timing_of(profile: Profile) -> Timing:
    """The durations of a profile; the deadman is never shorter than three control periods."""
    heartbeat_s, act_s, deadman_s, rank_step_s, chain_silence_s, remove_silence_s = _PROFILES[profile]
    deadman_s = max(deadman_s, DEADMAN_PERIODS_MIN * CONTROL_PERIOD_S)
    return Timing(heartbeat_s, act_s, deadman_s, rank_step_s, chain_silence_s, remove_silence_s)
