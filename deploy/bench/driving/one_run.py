"""One run of a driving bench in virtual time: its verdict, and its folder where it fell short.

A failing run leaves its run folder, and one line in a list beside it, from which the bench prints the failures by
cause. A run is the same however often it is repeated, so the command of that line shows the failure again.
"""

from __future__ import annotations

import re
import shutil
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import msgspec
from msgspec import Struct

from lfa.deploy.analysis.summary import Summary
from lfa.world.description.load import Scenario

FAILURES = "failures.jsonl"
NUMBER = re.compile(r"-?\d+(\.\d+)?")


class DrivenRun(NamedTuple):
    """Run that has ended: its summary, and its folder, which lasts until the end of the `with` block."""

    summary: Summary
    folder: Path
    faults: tuple[str, ...]


class DrivingFailure(Struct, frozen=True):
    """Run that fell short: the row it belongs to, why, where its folder is, and the command that repeats it."""

    row: str
    cause: str
    folder: str
    command: str


@contextmanager
def driven(scenario: Scenario, seed: int, faults: Sequence[str] = ()) -> Iterator[DrivenRun]:
    """Simulate a run of `scenario` drawn with `seed`, with `faults` besides the scenario's own.

    Raises KeyboardInterrupt when a signal ended it.
    """
    from lfa.deploy.faults.script import parse_all
    from lfa.deploy.run.simulate import run as simulate

    folder = Path(tempfile.mkdtemp(prefix="lfa-motion-"))
    try:
        planned = parse_all(scenario.mission, scenario.faults, faults)
        summary = simulate(scenario, seed, folder / "run", planned).summary
        if summary.outcome == "interrupted":  # a signal ended the run, so the bench ends too
            raise KeyboardInterrupt
        yield DrivenRun(summary, folder / "run", tuple(faults))
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def loaded(name: str, text: str, sets: Sequence[str] = ()) -> Scenario:
    """Return the scenario of a file with `text`. Raises Refused as `load` does."""
    from lfa.world.description.load import load

    with tempfile.TemporaryDirectory(prefix="lfa-motion-") as folder:
        path = Path(folder) / f"{name}.toml"
        path.write_text(text, encoding="utf-8")
        return load(str(path), sets)


def complaint(summary: Summary) -> str | None:
    """Return the reason why a run is not good, or None if it is good."""
    if summary.exit_code != 0:
        return summary.reason or ", ".join(one.name for one in summary.assertions if not one.ok)
    if summary.violations:
        return ", ".join(one.invariant for one in summary.violations)
    if summary.left_behind:
        return f"left behind: {summary.left_behind}"
    return contacts_text(summary)


def contacts_text(summary: Summary) -> str | None:
    """Return how many contacts a run had; None without one."""
    contacts = sum(robot.contacts for robot in summary.robots)
    return f"{contacts} contacts" if contacts else None


def note(row: str, done: DrivenRun, wrong: str | None, failed: Path) -> None:
    """Say how the run ended; where it fell short (`wrong`), keep its folder below `failed` and add it to the list."""
    seed = done.summary.seed
    print(f"{row}, seed {seed}: {wrong or 'ok'}, {done.summary.sim_duration_s:.0f} s", file=sys.stderr, flush=True)
    if wrong is None:
        return
    kept = failed / f"{re.sub('[^A-Za-z0-9.]+', '_', row)}-{seed}"
    shutil.rmtree(kept, ignore_errors=True)
    kept.parent.mkdir(parents=True, exist_ok=True)
    shutil.move(done.folder, kept)
    extra = "".join(f" --fault '{fault}'" for fault in done.faults)
    command = f"lfa sim {kept / 'scenario.toml'} --seed {seed}{extra}"
    line = msgspec.json.encode(DrivingFailure(row, wrong, str(kept), command)) + b"\n"
    with (failed / FAILURES).open("ab") as file:  # one write a line: several processes may add theirs
        file.write(line)


def by_cause(failed: Path) -> dict[str, list[DrivingFailure]]:
    """Return the failures listed below `failed`, most frequent cause first; causes that differ in numbers are one."""
    path = failed / FAILURES
    if not path.is_file():
        return {}
    found: dict[str, list[DrivingFailure]] = {}
    for line in path.read_bytes().splitlines():
        failure = msgspec.json.decode(line, type=DrivingFailure)
        found.setdefault(NUMBER.sub("#", failure.cause), []).append(failure)
    return dict(sorted(found.items(), key=lambda item: -len(item[1])))


def show_failures(failed: Path, as_json: bool) -> None:
    """Print each cause with its count, then its runs with their folders; beside JSON to stderr."""
    for failures in by_cause(failed).values():
        lines = [f"{len(failures)} x {failures[0].cause}", *(f"    {one.row}: {one.folder}" for one in failures)]
        print("\n".join(lines), file=sys.stderr if as_json else sys.stdout)
