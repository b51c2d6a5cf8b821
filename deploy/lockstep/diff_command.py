"""`lfa diff A B`: the first tick at which two runs in virtual time differ, and the process that differs first."""

from __future__ import annotations

from bisect import bisect_left
from itertools import zip_longest
from pathlib import Path
from typing import Annotated

import msgspec
import typer
from msgspec import Struct

from lfa.deploy.recording.run_folder import JOURNALS
from lfa.deploy.terminal_text import print_visible
from lfa.protocol.errors import Refused
from lfa.protocol.file_reading import read_text
from lfa.protocol.runtime import journal
from lfa.protocol.runtime.journal import JournalEntry
from lfa.protocol.runtime.state_hashes import ENDED, HASHES

HASHES_BYTES_MAX = 512 * 1024 * 1024
"""Length [bytes] above which a file of state hashes is refused: that of a day with a hundred processes is below it."""

RunFolder = Annotated[Path, typer.Argument(help="Folder of a run by lfa sim or lfa run --lockstep.")]


class Divergence(Struct, frozen=True):
    """First difference of two runs; `tick` is None if there is none in the ticks that both have."""

    ticks: tuple[int, int]
    """Number of rows of either run."""
    tick: int | None = None
    time_s: float | None = None
    first: tuple[str, ...] = ()
    """Processes that differ first: with the same inputs, where the hashes tell."""
    others: tuple[str, ...] = ()
    """Processes that differ at the same tick, with other inputs."""
    call: str | None = None
    """First call that differs, from the journals."""


class _Hashes(Struct, frozen=True):
    """Rows of one file: the names of the columns, and per tick its time [s] and columns."""

    names: tuple[str, ...]
    times: list[float]
    columns: list[tuple[str, ...]]


def command(
    a: RunFolder,
    b: RunFolder,
    as_json: Annotated[bool, typer.Option("--json", help="Print the difference as JSON.")] = False,
) -> int:
    """Compare two runs tick by tick; return 0 if they are the same, 1 if not. Raises Refused."""
    found = compare(a, b)
    print_visible(msgspec.json.encode(found).decode() if as_json else _text(found, a, b))
    return 0 if found.tick is None and found.ticks[0] == found.ticks[1] else 1


def compare(a: Path, b: Path) -> Divergence:
    """Return the first difference of the runs in the folders `a` and `b`. Raises Refused for what is no such folder."""
    left, right = _read(a), _read(b)
    if left.names != right.names:
        raise Refused(f"{a}, {b}: have processes {' '.join(left.names)} and {' '.join(right.names)}, must be the same")
    ticks = len(left.times), len(right.times)
    both = range(min(ticks))
    # A hash covers all calls so far: once two runs differ they stay different.
    first = bisect_left(both, True, key=lambda tick: left.columns[tick] != right.columns[tick])
    if first == len(both):
        return Divergence(ticks)
    pairs = list(zip(left.names, left.columns[first], right.columns[first], strict=True))
    causes = tuple(name for name, one, two in pairs if one != two and _caused(one, two))
    differing = tuple(name for name, one, two in pairs if one != two)
    names = causes or differing
    call = _first_call(a, b, names)
    return Divergence(ticks, first, left.times[first], names, tuple(n for n in differing if n not in names), call)


def _caused(one: str, two: str) -> bool:
    """Return True if a process differs by itself: with the same inputs, or because it runs in one of the runs only."""
    return ENDED in (one, two) or one.partition("/")[0] == two.partition("/")[0]


def _read(folder: Path) -> _Hashes:
    path = folder / HASHES
    try:
        lines = read_text(path, HASHES_BYTES_MAX).splitlines()
        rows = [line.split() for line in lines]
        names = tuple(rows[0][2:])
        whole = [row for row in rows[1:] if len(row) == len(names) + 2]
        if rows[0][:2] != ["tick", "time_s"]:
            raise ValueError
        return _Hashes(names, [float(row[1]) for row in whole], [tuple(row[2:]) for row in whole])
    except OSError as error:
        right = "must be the folder of a run by lfa sim or lfa run --lockstep"
        raise Refused(f"{path}: {error.strerror}: {right}") from None
    except (ValueError, IndexError):
        raise Refused(f"{path}: cannot be read, must be state hashes as a run wrote them") from None


def _first_call(a: Path, b: Path, names: tuple[str, ...]) -> str | None:
    """Return the first call in which the journals of one of the processes differ; None without such journals."""
    found: list[tuple[float, str]] = []
    for name in names:
        for file in sorted((a / JOURNALS).glob(f"{name}-*.bin")):
            other = b / JOURNALS / file.name
            if other.is_file():
                found += _calls(name, file, other)
    return min(found)[1] if found else None


def _calls(name: str, file: Path, other: Path) -> list[tuple[float, str]]:
    """Return time [s] and text of the first call that differs in two journals of a process; empty if none does."""
    try:
        _, one = journal.read(file)
        _, two = journal.read(other)
    except ValueError:
        return []
    for number, (left, right) in enumerate(zip_longest(one, two), start=1):
        if left == right:
            continue
        entry = left or right
        assert isinstance(entry, JournalEntry)
        what = "tick" if entry.kind == "tick" else entry.key or "local event"
        how = "is in one run only"
        if left is not None and right is not None:
            same = (left.kind, left.at, left.key, left.payload) == (right.kind, right.at, right.key, right.payload)
            how = "has other answers" if same else "has another input"
        return [(entry.at, f"{name}'s call {number}, {what} at {entry.at:.6f} s, {how}")]
    return []


def _text(found: Divergence, a: Path, b: Path) -> str:
    if found.tick is None:
        most = min(found.ticks)
        longer = "" if found.ticks[0] == found.ticks[1] else f"; {a if found.ticks[0] > most else b} goes on"
        return f"the same in all {most} ticks{longer}"
    lines = [f"the same up to tick {found.tick - 1}; tick {found.tick} ({found.time_s:.3f} s) differs"]
    lines.append(f"  first: {', '.join(found.first)}" + (f" (then {', '.join(found.others)})" if found.others else ""))
    if found.call is not None:
        lines.append(f"  {found.call}")
    return "\n".join(lines)
