"""`lfa teleop`: drives the leader by keyboard, 20 times a second; releasing the keys brakes."""

from __future__ import annotations

import os
import select
import sys
import termios
import tty
from typing import Annotated

import typer

from lfa.deploy.client.operator import Operator
from lfa.deploy.client.session import Subscriber, find, listen
from lfa.deploy.operate.options import Connect, FleetName, Keys
from lfa.deploy.terminal_text import print_visible
from lfa.protocol import clock, incarnations
from lfa.protocol.errors import Refused
from lfa.protocol.transport.message_bus import send

PERIOD_S = 0.05
RELEASED_S = 0.55
"""Time [s] without a key after which it counts as released: terminals repeat a held key after half a second."""
HEARD_S = 3.0
"""Time [s] within which something of a fleet that runs is heard."""
HELP = "w forward, s back, a left, d right, space brakes, q quits; the team goes on with its order 2 s after"

#                      v, omega as shares of --speed and --turn
KEYS: dict[str, tuple[float, float]] = {"w": (1.0, 0.0), "s": (-1.0, 0.0), "a": (0.0, 1.0), "d": (0.0, -1.0)}


def command(
    speed: Annotated[float, typer.Option(help="Speed [m/s] forward and back.")] = 0.3,
    turn: Annotated[float, typer.Option(help="Turn rate [rad/s].")] = 0.4,
    fleet: FleetName = None,
    connect: Connect = None,
    keys: Keys = None,
) -> int:
    """Drive until q or Ctrl-C; return 0. Raises Refused without a terminal or a fleet, or for speeds that are none."""
    if not (0.0 < speed < float("inf") and 0.0 < turn < float("inf")):
        raise Refused(f"--speed {speed:g} --turn {turn:g}: must be above 0 [m/s, rad/s]")
    if not sys.stdin.isatty():
        raise Refused("teleop needs a terminal: its keys are read one by one")
    with listen(find(fleet, connect, keys), frozenset()) as subscriber:
        subscriber.refuse_absent("teleop", HEARD_S)
        print_visible(HELP)
        before = termios.tcgetattr(sys.stdin)
        tty.setcbreak(sys.stdin)
        try:
            _drive(subscriber, speed, turn)
        finally:
            termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)
    return 0


def _drive(subscriber: Subscriber, speed: float, turn: float) -> None:
    operator = Operator(subscriber.fleet.name, incarnations.drawn())
    held, pressed_at = (0.0, 0.0), clock.now()
    while True:
        ready, _, _ = select.select([sys.stdin], [], [], PERIOD_S)
        now = clock.now()
        if ready:
            key = os.read(sys.stdin.fileno(), 32).decode(errors="ignore")[-1:]
            if key in ("q", ""):
                break
            held, pressed_at = KEYS.get(key, (0.0, 0.0)), now
        elif now - pressed_at > RELEASED_S:
            held = (0.0, 0.0)
        v, omega = speed * held[0], turn * held[1]
        drive = operator.command("teleop", now, v_mps=v, omega_radps=omega)
        send(subscriber.bus, drive, operator.stop(None, (), now))
    send(subscriber.bus, operator.command("teleop", clock.now(), v_mps=0.0, omega_radps=0.0))
