"""The header of every message, and bounded number types."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta, Struct

from lfa.protocol.geometry import NUMBER_MAX

WIRE_VERSION = 1


MESSAGE_BYTES_MAX = 64 * 1024


Count = Annotated[int, Meta(ge=0, le=2**53)]
"""Whoever hears one can add to it and say the sum: msgpack ends at 2**64, what a JSON reader keeps exactly at 2**53."""


Stamp = Annotated[float, Meta(ge=-1e12, le=1e12)]
"""A moment of somebody's own clock, or the difference of two [s]; also of one that counts from 1970."""


Step = Annotated[float, Meta(ge=0.001, le=NUMBER_MAX)]
"""From one reading to the next [m]: whoever goes along them gets to the end."""


class Header(Struct, frozen=True, array_like=True, gc=False):
    """Who says it, in which of its lives, as how manieth on this topic, and when by its own clock [s]."""

    sender: str
    incarnation: Count
    seq: Count
    stamp: Stamp
