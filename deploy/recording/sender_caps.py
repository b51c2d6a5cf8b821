"""Caps on what one member may add to a recording, so that a single key cannot fill the recorder's disk or memory."""

from __future__ import annotations

import sys

from lfa.protocol.output import write_line
from lfa.protocol.topics import TRUTH_OWNER, WORLD_NAME

BYTES_PER_S_MAX = 1024 * 1024
"""Bytes [1/s] recorded of one member; a robot with a lidar of 2000 beams at 10 Hz has an eighth of it."""
SIMULATED_BYTES_PER_S_MAX = 8 * BYTES_PER_S_MAX
"""The same for the world, which reports on all robots."""
BURST_S = 4.0
"""Duration [s] of silence whose bytes may be recorded at once, after a stall of a link or a process."""
CHANNELS_MAX = 256
"""Number of keys recorded of one member; MCAP has 65535 channels in all."""
OWNERS_MAX = 128
"""Number of members with a cap of their own; the rest share one, under the name OTHERS."""
OTHERS = "others"


class SenderCaps:
    """Allowance of each member, by the owner of its keys: a bucket of bytes, and the keys seen.

    `left_out` counts the messages of each member that were left out.
    """

    def __init__(self) -> None:
        self._allowances: dict[str, tuple[float, float]] = {}
        """Remaining bytes, negative after a message larger than what was left, and the time [s] of that number."""
        self._channels: dict[str, set[str]] = {}
        self.left_out: dict[str, int] = {}

    def admits(self, t: float, key: str) -> bool:
        """Return True if a message on `key` may be recorded at `t` [s]; otherwise count it."""
        owner = self._owner(key)
        rate = _rate(owner)
        left, since = self._allowances.get(owner, (rate * BURST_S, t))
        left = min(left + rate * max(t - since, 0.0), rate * BURST_S)
        self._allowances[owner] = left, max(t, since)
        channels = self._channels.setdefault(owner, set())
        if left <= 0.0 or (key not in channels and len(channels) >= CHANNELS_MAX):
            self._leave_out(owner)
            return False
        channels.add(key)
        return True

    def spend(self, key: str, count: int) -> None:
        """Take `count` bytes, which were recorded, from the allowance of the owner of `key`."""
        owner = self._owner(key)
        left, since = self._allowances[owner]
        self._allowances[owner] = left - count, since

    def _owner(self, key: str) -> str:
        owner = key.split("/", 3)[2]
        known = owner in self._allowances or len(self._allowances) < OWNERS_MAX
        return owner if known else OTHERS

    def _leave_out(self, owner: str) -> None:
        if owner not in self.left_out:
            limit = f"{_rate(owner) / 1e6:.1f} MB/s on {CHANNELS_MAX} keys"
            write_line(f"{owner} sends more than {limit}: the rest is not recorded", sys.stderr)
        self.left_out[owner] = self.left_out.get(owner, 0) + 1


def _rate(owner: str) -> float:
    return SIMULATED_BYTES_PER_S_MAX if owner in (WORLD_NAME, TRUTH_OWNER) else BYTES_PER_S_MAX
