"""CDR as ROS 2 nodes write it (XCDR1, little endian), for the messages that a fleet becomes. Pure.

A message that is sent fifty times a second per robot has a `Form`: its strings, which never change, are laid out once,
and a message is one call of `struct`. All others are put together by a `CdrWriter`. `rosbags`, which reads what comes
from ROS, writes the same bytes; it takes ten to twenty times as long, and with numpy a fifth of the bridge's memory.
"""

from __future__ import annotations

import sys
from array import array
from collections.abc import Iterable
from struct import Struct, pack
from typing import NamedTuple

NS = 1_000_000_000
CDR_LITTLE_ENDIAN = b"\x00\x01\x00\x00"
SECONDS_MAX = 2**31 - 1
"""Largest number of seconds of a ROS time; later and earlier times are written as the last or the first there is."""


class CdrMessage(NamedTuple):
    """Encoded message and its type, like `nav_msgs/msg/Odometry`."""

    type: str
    payload: bytes


class CdrWriter:
    """Writer of one message; a number lies at a multiple of its size, counted from `at` = 0 behind the header."""

    def __init__(self, at: int = 0) -> None:
        self._at = at
        self._bytes = bytearray()

    def align(self, size: int) -> CdrWriter:
        """Add zeros up to the next multiple of `size`."""
        gap = -(self._at + len(self._bytes)) % size
        if gap:
            self._bytes += bytes(gap)
        return self

    def int8(self, *values: int) -> CdrWriter:
        """Add signed or unsigned numbers of one byte, and truth values."""
        self._bytes += bytes(value & 0xFF for value in values)
        return self

    def int32(self, *values: int) -> CdrWriter:
        """Add numbers of four bytes, as are the counts before sequences."""
        self.align(4)
        self._bytes += pack(f"<{len(values)}i", *values)
        return self

    def float32(self, *values: float) -> CdrWriter:
        self.align(4)
        self._bytes += floats(values)
        return self

    def float64(self, *values: float) -> CdrWriter:
        self.align(8)
        self._bytes += pack(f"<{len(values)}d", *values)
        return self

    def string(self, *texts: str) -> CdrWriter:
        for text in texts:
            encoded = text.encode()
            self.int32(len(encoded) + 1)
            self._bytes += encoded + b"\0"
        return self

    def time(self, stamp_ns: int) -> CdrWriter:
        return self.int32(*split(stamp_ns))

    def octets(self, data: bytes) -> CdrWriter:
        """Add bytes as they are, such as a part that was written before for the same alignment."""
        self._bytes += data
        return self

    def bytes(self) -> bytes:
        return bytes(self._bytes)

    def message(self, of_type: str) -> CdrMessage:
        return CdrMessage(of_type, CDR_LITTLE_ENDIAN + self._bytes)


class Form:
    """Layout of a message, or of a part of it, that begins with a time and strings that never change."""

    def __init__(self, strings: Iterable[str], numbers: str, *, align: int = 8, at: int = 0) -> None:
        """`numbers`: format as of `struct`, in which `8x` is a zero; `align`: size of the first of them."""
        constant = CdrWriter(at + 8).string(*strings).align(align).bytes()
        self._constant = constant
        self._struct = Struct(f"<iI{len(constant)}s{numbers}")

    def pack(self, stamp_ns: int, *numbers: float) -> bytes:
        return self._struct.pack(*split(stamp_ns), self._constant, *numbers)


def split(stamp_ns: int) -> tuple[int, int]:
    """Return whole seconds and nanoseconds of a time, within what a ROS time can say."""
    seconds, rest = divmod(stamp_ns, NS)
    return max(-SECONDS_MAX, min(seconds, SECONDS_MAX)), rest


def floats(values: Iterable[float]) -> bytes:
    """Return numbers of four bytes; what is too large for one becomes infinite."""
    written = array("f", values)
    if sys.byteorder == "big":
        written.byteswap()
    return written.tobytes()
