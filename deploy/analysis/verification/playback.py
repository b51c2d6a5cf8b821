"""Playback of a recording onto a bus at the recorded times; views receive it like the messages of a running fleet."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from msgspec import DecodeError

from lfa.deploy.recording import mcap_channels
from lfa.deploy.recording.mcap_reader import look_into, recorded
from lfa.deploy.terminal_text import print_visible
from lfa.protocol import clock
from lfa.protocol.errors import Refused
from lfa.protocol.messages.codec import encode
from lfa.protocol.topics import TOPIC, fleet_name
from lfa.protocol.transport.bus import Inbox
from lfa.protocol.transport.zenoh_bus import ZenohBus
from lfa.protocol.transport.zenoh_config import answers, default_endpoint
from lfa.protocol.transport.zenoh_router import open_router

AHEAD_S_MIN = 0.002
"""Minimum wait [s] that is worth a sleep."""


def play(folder: Path, speed: float, fleet: str, endpoint: str | None) -> int:
    """Publish the recording in `folder` as `fleet`, `speed` times as fast; needs no running router.

    Raises Refused for a bad speed, an unreadable recording, or no router at a given endpoint.
    """
    if not speed > 0.0:
        raise Refused(f"--speed {speed:g}: must be a number above 0")
    look_into(folder)
    fleet_name(fleet)
    with _bus(endpoint or default_endpoint(), may_open=endpoint is None) as bus:
        print_visible(f"plays {folder} as fleet {fleet}; look at it with: lfa watch --fleet {fleet}", flush=True)
        begun, count, t = clock.now(), 0, 0.0
        for channel, t, body in recorded(folder, frozenset(TOPIC)):
            ahead_s = t / speed - (clock.now() - begun)
            if ahead_s > AHEAD_S_MIN:
                clock.sleep(ahead_s)
            try:
                message = mcap_channels.restore(body, TOPIC[channel.split("/")[2]].type)
            except DecodeError as error:
                raise Refused(f"{folder}: recorded by another program or version, {channel}: {error}") from None
            bus.publish(f"lfa/{fleet}{channel}", encode(message))
            count += 1
    print_visible(f"{count} messages, {t:.1f} s in {clock.now() - begun:.1f} s")
    return 0


@contextmanager
def _bus(endpoint: str, *, may_open: bool) -> Iterator[ZenohBus]:
    """Yield a session at `endpoint`; if no router answers, open one, or raise Refused without `may_open`."""
    here = answers(endpoint)
    if not here and not may_open:
        raise Refused(f"--connect {endpoint}: no router answers there, start one with lfa-router")
    close = None if here else open_router([endpoint])
    try:
        bus = ZenohBus(endpoint, Inbox())
        try:
            yield bus
        finally:
            bus.close()
    finally:
        if close is not None:
            close()
