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


class Allowance:
    """What one member may still have recorded: `left` bytes at the time `since` [s], negative after a large message."""

    def __init__(self, owner: str, t: float) -> None:
        self.owner = owner
        self.rate = SIMULATED_BYTES_PER_S_MAX if owner in (WORLD_NAME, TRUTH_OWNER) else BYTES_PER_S_MAX
        self.left = self.most = self.rate * BURST_S
        self.since = t
        self.keys = 0
        """Number of keys admitted."""


class SenderCaps:
    """Allowance of each member, by the owner of its keys: a bucket of bytes, and the keys seen.

    `left_out` counts the messages of each member that were left out.
    """

    def __init__(self) -> None:
        self._allowances: dict[str, Allowance] = {}
        self._of_key: dict[str, Allowance] = {}
        """Allowance of each key that has been admitted."""
        self.left_out: dict[str, int] = {}

    def admits(self, t: float, key: str) -> Allowance | None:
        """Return the allowance to spend from if a message on `key` may be recorded at `t` [s]; otherwise count it."""
        known = self._of_key.get(key)
        allowance = self._allowance(t, key) if known is None else known
        if t > allowance.since:
            left = allowance.left + allowance.rate * (t - allowance.since)
            allowance.left = left if left < allowance.most else allowance.most
            allowance.since = t
        if allowance.left <= 0.0 or (known is None and allowance.keys >= CHANNELS_MAX):
            self._leave_out(allowance)
            return None
        if known is None:
            allowance.keys += 1
            self._of_key[key] = allowance
        return allowance

    def _allowance(self, t: float, key: str) -> Allowance:
        owner = key.split("/", 3)[2]
        if owner not in self._allowances and len(self._allowances) >= OWNERS_MAX:
            owner = OTHERS
        return self._allowances.setdefault(owner, Allowance(owner, t))

    def _leave_out(self, allowance: Allowance) -> None:
        owner = allowance.owner
        if owner not in self.left_out:
            limit = f"{allowance.rate / 1e6:.1f} MB/s on {CHANNELS_MAX} keys"
            write_line(f"{owner} sends more than {limit}: the rest is not recorded", sys.stderr)
        self.left_out[owner] = self.left_out.get(owner, 0) + 1
