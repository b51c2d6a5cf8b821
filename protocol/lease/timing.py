"""Durations of the lease protocol: the four profiles of lease.md 3.4, and the values derived from them.

Only the numbers of the table are constants. `T_grant` follows from them: the leader counts its lease from before
its request, a voter from the request's arrival, on clocks whose rates differ by at most `CLOCK_RATE_ERROR` either
way, and a leader's last command moves its robot for one more deadman.
"""

from __future__ import annotations

from functools import cache
from math import ceil

from msgspec import Struct, structs

from lfa.protocol.mission import CONTROL_HZ, Mission, Profile

CLOCK_RATE_ERROR = 1e-3
"""Maximum rate error eps of a monotonic clock (rate within 1 +- eps); oscillators and NTP slewing stay below half."""
CONTROL_PERIOD_S = 1.0 / CONTROL_HZ
DEADMAN_PERIODS_MIN = 3
SHORTER_ACT_S: dict[Profile, tuple[float, ...]] = {"auto": (0.4, 0.8)}
"""Shorter leases [s] that a holder may ask for in its rounds while renewing is quick, the shortest first (E36)."""
ACT_HEARTBEATS, CHAIN_ACTS, REMOVE_ACTS = 8.0, 2.0, 3.75
"""Lease in heartbeats, and silences until out of the chain and out of the voters in leases, of such a shorter lease."""


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
    shorter_act_s: tuple[float, ...] = ()
    """Shorter leases [s] that the holder may ask for instead of T_act, the shortest first (E36)."""

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
    "auto":               (0.100,    1.600, 0.200,  0.030, 3.200, 6.000),
}  # fmt: skip


def timing_of(profile: Profile, control_hz: float = CONTROL_HZ) -> Timing:
    """Return the durations of a profile; the deadman is never shorter than three control periods at `control_hz`."""
    heartbeat_s, act_s, deadman_s, rank_step_s, chain_silence_s, remove_silence_s = _PROFILES[profile]
    deadman_s = max(deadman_s, DEADMAN_PERIODS_MIN / control_hz)
    shorter_act_s = SHORTER_ACT_S.get(profile, ())
    return Timing(heartbeat_s, act_s, deadman_s, rank_step_s, chain_silence_s, remove_silence_s, shorter_act_s)


@cache
def lengths_of(timing: Timing) -> tuple[Timing, ...]:
    """Return the durations of a holder for each lease that it may ask for, the shortest first; the last is `timing`."""
    return (*(_shorter(timing, act_s) for act_s in timing.shorter_act_s), timing)


def _shorter(timing: Timing, act_s: float) -> Timing:
    """Return the durations that go with a lease of `act_s` [s]; D stays, and with it what a gateway does."""
    return structs.replace(
        timing,
        heartbeat_s=min(timing.heartbeat_s, act_s / ACT_HEARTBEATS),
        act_s=act_s,
        chain_silence_s=CHAIN_ACTS * act_s,
        remove_silence_s=REMOVE_ACTS * act_s,
        shorter_act_s=(),
    )


def timing_for(mission: Mission) -> Timing:
    """Return the durations that all processes of a mission keep."""
    return timing_of(mission.profile, mission.control_hz)
