"""`lfa topic`: list the topics of a running fleet, measure their rates, and print their messages."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from math import inf
from pathlib import Path
from typing import Annotated, Literal

import msgspec
import typer
from msgspec import Struct

from lfa.deploy.client.session import FleetAddress, find, listen
from lfa.deploy.recording import mcap_channels
from lfa.deploy.terminal_text import print_visible
from lfa.protocol import clock
from lfa.protocol.errors import Refused
from lfa.protocol.names import WITNESS_NAME, robot_id_of
from lfa.protocol.topics import (
    DRIVER_PREFIX,
    HOST_PREFIX,
    OPERATOR_NAME,
    RECORDER_NAME,
    TOPIC,
    TRUTH_OWNER,
    WORLD_NAME,
)

POLL_S = 0.1
SILENCE_S = 3.0
SPEAKERS = ("*", WITNESS_NAME, WORLD_NAME, OPERATOR_NAME, RECORDER_NAME, TRUTH_OWNER)


class Rate(Struct, frozen=True):
    """Measured traffic of one channel: rate [Hz], nominal rate of the topic table [Hz], mean message size [bytes]."""

    channel: str
    type: str
    hz: float
    table_hz: float | None
    bytes_mean: float


def command(
    action: Annotated[Literal["list", "echo", "hz"], typer.Argument(help="Action on the topics.")],
    topic: Annotated[str, typer.Argument(help="robot2/pose, robot2 or pose; default all topics.")] = "",
    fleet: Annotated[str | None, typer.Option(help="Name of the fleet; required when several run here.")] = None,
    connect: Annotated[str | None, typer.Option(help="Endpoint of a router; default the fleet's own here.")] = None,
    keys: Annotated[Path | None, typer.Option(help="Folder written by lfa keys, for a secured fleet.")] = None,
    count: Annotated[int, typer.Option(help="Echo: number of messages to print; 0 for no limit.")] = 0,
    seconds: Annotated[float, typer.Option(help="List and hz: time to listen [s].")] = 2.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print as JSON; echo always does.")] = False,
) -> int:
    wanted = expressions(topic)
    if count < 0 or not 0.0 < seconds < inf:
        raise Refused(f"--count {count} --seconds {seconds:g}: must be 0 or more, and above 0")
    found = find(fleet, connect, keys)
    if action == "echo":
        return _echo(found, wanted, count, topic or "anything")
    rates = _rates(found, wanted, seconds)
    if as_json:
        print_visible(msgspec.json.encode(rates).decode())
    else:
        print_visible("\n".join(_lines(rates, with_rates=action == "hz")))
    return 0 if rates else 1


def expressions(text: str) -> frozenset[str]:
    """Return the key expressions, without the fleet's part, for `robot2/pose`, `robot2` or `pose`. Raises Refused."""
    owner, _, name = text.partition("/")
    if not name and owner in TOPIC:
        owner, name = "*", owner
    named = robot_id_of(owner) is not None or owner in SPEAKERS or owner.startswith((HOST_PREFIX, DRIVER_PREFIX))
    if (name and name not in TOPIC) or (owner and not named):
        raise Refused(f"topic {text!r}: must be such as robot2/pose, robot2 or pose, of {', '.join(TOPIC)}")
    return frozenset({f"{owner or '*'}/{name or '*'}", f"{owner or '*'}/{name or '*'}/*"})


def _echo(fleet: FleetAddress, wanted: frozenset[str], count: int, what: str) -> int:
    """Print every message as one line of JSON, with its channel."""
    left = count
    silent_at = clock.now() + SILENCE_S
    with listen(fleet, wanted, every=True) as subscriber:
        while True:
            subscriber.wait(POLL_S)
            if left == count and clock.now() > silent_at:
                print_visible(f"nothing is heard of {what} yet (lfa topic list)", file=sys.stderr, flush=True)
                silent_at = inf
            for arrival, message in subscriber.take():
                channel = msgspec.json.encode(arrival.key.split("/", 2)[2]).decode()
                print_visible(f'{{"channel":{channel},"message":{mcap_channels.encode(message).decode()}}}', flush=True)
                left -= 1
                if left == 0:
                    return 0


def _rates(fleet: FleetAddress, wanted: frozenset[str], seconds: float) -> list[Rate]:
    heard: dict[str, tuple[int, int]] = {}
    with listen(fleet, wanted, every=True) as subscriber:
        begun = clock.now()
        while clock.now() < begun + seconds:
            subscriber.wait(min(POLL_S, seconds))
            for arrival, _ in subscriber.take():
                channel = arrival.key.split("/", 2)[2]
                number, size = heard.get(channel, (0, 0))
                heard[channel] = (number + 1, size + len(arrival.payload))  # type: ignore[arg-type]
        lasted_s = clock.now() - begun
    return [_rate(channel, *heard[channel], lasted_s) for channel in sorted(heard)]


def _rate(channel: str, number: int, size: int, lasted_s: float) -> Rate:
    topic = TOPIC[channel.split("/")[1]]
    return Rate(channel, topic.type.__name__, round(number / lasted_s, 2), topic.rate_hz, round(size / number, 1))


def _lines(rates: Iterable[Rate], *, with_rates: bool) -> list[str]:
    rows = [("channel", "type", "Hz", "of", "bytes") if with_rates else ("channel", "type")]
    for rate in rates:
        wanted = "events" if rate.table_hz is None else f"{rate.table_hz:g}"
        row = (rate.channel, rate.type)
        rows.append((*row, f"{rate.hz:.1f}", wanted, f"{rate.bytes_mean:.0f}") if with_rates else row)
    widths = [max(len(row[n]) for row in rows) for n in range(len(rows[0]))]
    return ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
