"""The header of every message, and bounded number types."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta, Struct

from lfa.protocol.geometry import NUMBER_MAX

WIRE_VERSION = 6
"""Version of the messages: it grows with each change of a message's fields (E35)."""
AGREED_WIRE = 5
"""Version that the digest of an agreement names (E25): of the oldest messages that are still understood. It grows when
a message changes otherwise than by `WIRE_ADDS`, one version after those who send the new form can be heard."""
UNSAID_WIRE = 5
"""Version of a sender whose messages have no field `wire` yet."""
WIRE_ADDS: dict[int, tuple[str, ...]] = {
    6: (
        *("Prepare.wire", "Propose.wire", "Hello.wire", "CmdVel.grant_s", "Sensors.grant_s", "Propose.grant_ms"),
        *("StopReport.robots", "MissionNote.footprint_m"),
    ),
}
"""Fields that each version adds, at the end of their messages and with a default: earlier versions skip them."""
MESSAGE_BYTES_MAX = 64 * 1024
Count = Annotated[int, Meta(ge=0, le=2**53)]
"""Non-negative integer up to 2**53, so that increments still fit msgpack (2**64) and stay exact in JSON (2**53)."""
Stamp = Annotated[float, Meta(ge=-1e12, le=1e12)]
"""Time of one process's own clock, or a difference of two [s]; the bound also admits clocks that count from 1970."""
Step = Annotated[float, Meta(ge=0.001, le=NUMBER_MAX)]
"""Distance [m] between two readings; positive, so that a loop over the readings ends."""


class Header(Struct, frozen=True, array_like=True, gc=False):
    """Sender, its incarnation, the sequence number on this topic, and the time [s] on the sender's own clock."""

    sender: str
    incarnation: Count
    seq: Count
    stamp: Stamp
