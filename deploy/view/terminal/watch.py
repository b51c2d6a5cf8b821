"""`lfa watch`: live table for a terminal of 80 columns; keys inject faults and commands into the user's own fleet."""

from __future__ import annotations

import contextlib
import io
import os
import select
import shutil
import sys
import termios
import tty
from collections.abc import Iterator
from math import pi
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import msgspec
import typer

from lfa.deploy.client import stop_fleet
from lfa.deploy.client.operator import Operator
from lfa.deploy.client.session import Subscriber, find, listen
from lfa.deploy.client.team_status import Board, RobotStatus
from lfa.deploy.operate import fault, formation
from lfa.deploy.terminal_text import cell, print_visible
from lfa.protocol import clock, incarnations
from lfa.protocol.errors import Refused
from lfa.protocol.output import visible
from lfa.protocol.transport.message_bus import send

if TYPE_CHECKING:
    from rich.console import Group, RenderableType

REFRESH_S = 1.0  # drawing takes some 9 ms: at 2 Hz it used a fifth of the total CPU budget
FIRST_S = 1.3  # each process has published its status by then
WIDTH_MIN, HEIGHT_MIN = 60, 12
BEAT_S = 0.25
"""Time [s] between two signs that an operator is there (E31)."""
TOPICS = frozenset({"*/pose", "*/tracking", "*/status", "*/event"}) | stop_fleet.TOPICS
HEADS = ("robot", "role", "term", "ahead", "off mm", "turn °", "m/s", "age ms", "lag ms", "CPU %", "MiB", "state")
SIDES = ("left", "right", "column", "zigzag")
#        key   action
ACTION_KEYS = {"k": "kill", "s": "stop", "c": "continue", "x": "cut", "h": "heal"}
STOPS = {" ": True, "r": False}
HELP = "SPACE stop all, r resume, 1-9 robot, ? all keys, q quit"
KEYS = (
    "SPACE  stop all robots         r  let them drive on",
    "1-9    choose a robot          f  the next formation",
    "k      kill it, after asking   s  pause it    c  continue",
    "x      cut its links           h  heal all links",
    "?      this list               q  quit; the fleet goes on",
)
WIDE = 78
"""Width [characters] from which the table has all columns."""
PROCESS_HEADS = ("lag ms", "CPU %", "MiB")
"""Columns that a narrower terminal does without."""
ROLE_STYLES = {"leader": "bold green", "follower": "", "waiting": "yellow", "silent": "bold red", "unheard": "dim"}


def command(
    fleet: Annotated[str | None, typer.Option(help="Name of the fleet; required when several run here.")] = None,
    connect: Annotated[str | None, typer.Option(help="Endpoint of a router; default the fleet's own here.")] = None,
    keys: Annotated[Path | None, typer.Option(help="Folder written by lfa keys, for a secured fleet.")] = None,
    once: Annotated[bool, typer.Option("--once", help="Print the table once and exit.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the rows once as JSON and exit.")] = False,
) -> int:
    if not as_json:
        import rich  # noqa: F401  an extra: missed here, before anything is done
    if not (once or as_json):
        _check_terminal()
    found = find(fleet, connect, keys)
    board = Board(tuple(agent.robot for agent in found.team))
    with listen(found, TOPICS) as subscriber:
        if not (once or as_json):
            return _live(subscriber, board)
        _hear_for(subscriber, board, FIRST_S)
        rows = board.rows(clock.now())
    if as_json:
        print_visible(msgspec.json.encode({"fleet": found.name, "robots": rows}).decode())
    else:
        from rich.console import Console

        width = max(WIDTH_MIN, shutil.get_terminal_size().columns)
        Console(width=width).print(_table(rows, None, width, wraps=True))
    return 0 if any(row.pose_age_s is not None for row in rows) else 1


def _check_terminal() -> None:
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        raise Refused("watch needs a terminal: use --once or --json")
    size = shutil.get_terminal_size()
    if size.columns < WIDTH_MIN or size.lines < HEIGHT_MIN:
        right = f"must be at least {WIDTH_MIN} x {HEIGHT_MIN}, or use --once"
        raise Refused(f"terminal of {size.columns} x {size.lines} characters: {right}")


def _hear_for(subscriber: Subscriber, board: Board, duration_s: float) -> None:
    until = clock.now() + duration_s
    while clock.now() < until:
        clock.sleep(0.1)
        _hear(subscriber, board)


def _hear(subscriber: Subscriber, board: Board) -> None:
    for arrival, message in subscriber.take():
        board.see(arrival.at, message)
    board.sample(clock.now())


def _live(subscriber: Subscriber, board: Board) -> int:
    from rich.console import Console
    from rich.live import Live

    hand = KeyHandler(subscriber)
    console = Console()
    with _raw_keys(), Live(console=console, screen=True, auto_refresh=False) as live:
        while True:
            _hear(subscriber, board)
            live.update(_screen(subscriber, board, hand, console.width, console.height), refresh=True)
            for key in hand.await_keys():
                if key == "q":
                    return 0
                hand.press(key)


class KeyHandler:
    """Handler of key presses: digits select a robot, letters act on it. `said` is the result of the last key."""

    def __init__(self, subscriber: Subscriber) -> None:
        self._subscriber = subscriber
        self.chosen: int | None = None
        self.said = "" if subscriber.fleet.team else "this fleet is not yours to command: keys other than q do nothing"
        self._side = 0
        self._asked = False
        self.help = False
        """True while the list of keys is shown."""
        self._operator = Operator(subscriber.fleet.name, incarnations.drawn())

    def await_keys(self) -> str:
        """Return the keys pressed, after `REFRESH_S` at most; meanwhile the fleet hears that an operator is there."""
        until, pressed = clock.now() + REFRESH_S, ""
        while not pressed and clock.now() < until:
            send(self._subscriber.bus, self._operator.stop(None, (), clock.now()))
            pressed = _keys(BEAT_S)
        return pressed

    def press(self, key: str) -> None:
        asked, self._asked = self._asked, False
        if asked and key == "y":
            self._do("kill")
            return
        if asked:
            self.said = f"robot {self.chosen} is not killed"
        if key == "?":
            self.help = not self.help
            return
        if key in STOPS:
            self._stop(stand=STOPS[key])
        if not self._subscriber.fleet.team:
            return
        if key.isdecimal():
            self.chosen = int(key)
            self.said = f"robot {key} is chosen"
        elif key == "f":
            self._side = (self._side + 1) % len(SIDES)
            formation.say(self._subscriber, SIDES[self._side])
            self.said = f"formation {SIDES[self._side]} asked for"
        elif key == "k" and self.chosen is not None:
            self._asked = True
            self.said = f"kill the process of robot {self.chosen}? y: yes, any other key: no"
        elif key in ACTION_KEYS:
            self._do(ACTION_KEYS[key])

    def _stop(self, *, stand: bool) -> None:
        try:
            self.said = "; ".join(
                stop_fleet.outcome_lines(stop_fleet.stop_fleet(self._subscriber, stand=stand), stand=stand)
            )
        except Refused as refused:
            self.said = str(refused)

    def _do(self, action: str) -> None:
        if self.chosen is None and action != "heal":
            self.said = f"{action}: choose a robot first, by its digit"
            return
        target = "" if action == "heal" else str(self.chosen)
        printed = io.StringIO()
        try:
            with contextlib.redirect_stdout(printed):
                fault.command(action, target, fleet=self._subscriber.fleet.name, as_json=False)
        except Refused as refused:
            self.said = str(refused)
        else:
            self.said = printed.getvalue().strip()


def _screen(subscriber: Subscriber, board: Board, hand: KeyHandler, width: int, height: int) -> Group:
    from rich.console import Group
    from rich.text import Text

    rows = board.rows(clock.now())
    shown = rows[: max(1, height - 9)]
    leader = board.leader(clock.now())
    who = "nobody leads" if leader is None else f"robot {leader} leads"
    left = height - len(shown) - 7
    more = f", {len(rows) - len(shown)} more robots" if len(shown) < len(rows) else ""
    events = list(board.events)[-left:] if left > 0 and not hand.help else []
    return Group(
        Text(visible(f"fleet {subscriber.fleet.name}: {who}{more}"), style="bold", no_wrap=True),
        _table(shown, hand.chosen, width),
        _timeline(board, width),
        *(Text(visible(f" {_ago(e.at):>6} {e.who:<9} {e.what}"), no_wrap=True, overflow="ellipsis") for e in events),
        *(Text(f" {keys}", no_wrap=True) for keys in KEYS[: max(left, 0)] if hand.help),
        Text(visible(hand.said), style="cyan", no_wrap=True, overflow="ellipsis"),
        Text(HELP, style="dim", no_wrap=True, overflow="ellipsis"),
    )


def _table(rows: list[RobotStatus], chosen: int | None, width: int, *, wraps: bool = False) -> RenderableType:
    """Draw the robots; `wraps`: a state that is too long takes further lines, instead of being cut."""
    from rich.table import Table

    kept = [n for n, head in enumerate(HEADS) if width >= WIDE or head not in PROCESS_HEADS]

    table = Table(box=None, padding=(0, 1, 0, 0), pad_edge=False)
    for head in (HEADS[n] for n in kept):
        # rich takes what lacks in width from the columns that may wrap: from the state alone
        left, long = head in ("role", "state"), head == "state"
        table.add_column(head, justify="left" if left else "right", no_wrap=not long, overflow="ellipsis")
    for row in rows:
        cells = [cell(_cells(row)[n]) for n in kept]
        cells[-1].no_wrap = not wraps
        table.add_row(*cells, style="reverse" if row.robot == chosen else ROLE_STYLES.get(row.role, ""))
    return table


def _cells(row: RobotStatus) -> tuple[str, ...]:
    """Return the texts of a row; units are in the heads. A term is cut to its last four digits, where terms differ."""
    return (
        str(row.robot),
        row.role,
        "" if row.term is None else f"{row.term % 10000}",
        "" if row.predecessor is None else str(row.predecessor),
        _number(row.error_m, 1000.0),
        _number(row.heading_error_rad, 180.0 / pi),
        "" if row.speed_mps is None else f"{row.speed_mps:.2f}",
        _number(row.pose_age_s, 1000.0),
        _number(row.loop_lag_ms, 1.0),
        _number(row.cpu_percent, 1.0),
        _number(row.rss_mib, 1.0),
        row.state.removeprefix(f"{row.role}, "),
    )


def _number(value: float | None, scale: float) -> str:
    return "" if value is None else f"{round(scale * value)}"


def _timeline(board: Board, width: int) -> RenderableType:
    """Draw the leaders, one character a second: last digit of the leader's id, a dot for none."""
    from rich.text import Text

    room = max(10, width - 14)
    samples = list(board.leaders)[-room:]
    line = "".join("." if leader is None else str(leader % 10) for leader in samples)
    return Text(f"lease -{len(samples):>3} s {line}", style="green", no_wrap=True)


def _ago(at: float) -> str:
    return f"{max(0.0, clock.now() - at):.0f} s"


@contextlib.contextmanager
def _raw_keys() -> Iterator[None]:
    """Switch the terminal to single keys without echo; its mode is restored on exit."""
    before = termios.tcgetattr(sys.stdin)
    tty.setcbreak(sys.stdin)
    try:
        yield
    finally:
        termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)


def _keys(within_s: float) -> str:
    """Return the keys pressed; waits at most `within_s` [s] for the first."""
    ready, _, _ = select.select([sys.stdin], [], [], within_s)
    return os.read(sys.stdin.fileno(), 32).decode(errors="ignore") if ready else ""
