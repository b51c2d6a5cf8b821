"""`lfa verify`: check each run: the lease's invariants and, for a scenario of the paper, the figures' properties."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Annotated

import msgspec
import typer
from msgspec import Struct

from lfa.deploy.analysis.paper import across_seeds, criteria
from lfa.deploy.analysis.paper.across_seeds import Kept
from lfa.deploy.analysis.paper.checks import PAPER, PATHS, of_run
from lfa.deploy.analysis.paper.criteria import Finding
from lfa.deploy.analysis.run_data import Run
from lfa.deploy.analysis.summary import SUMMARY
from lfa.deploy.analysis.verification.checker import Violation
from lfa.deploy.analysis.verification.journals import JournalVerdict, verify
from lfa.deploy.analysis.verification.safety import SAFETY
from lfa.deploy.analysis.verification.shares import check_share
from lfa.deploy.campaign.shard import WHOLE, Shard, parse_shard
from lfa.deploy.own_code import OwnFile, RunBehavior, RunController, RunSensor, given_files
from lfa.deploy.recording import event_log
from lfa.deploy.recording.run_folder import JOURNALS
from lfa.deploy.scenario_loading import load_code_of_run
from lfa.deploy.terminal_text import print_visible
from lfa.protocol.errors import Refused
from lfa.protocol.output import write_line


class Checked(Struct, frozen=True):
    """Results of all checks of one run folder."""

    folder: str
    scenario: str
    seed: int
    journals: int
    happenings: int
    broken: tuple[Violation, ...]
    shapes: tuple[Finding, ...]
    """Findings of the paper checks; empty when the scenario is not one of the paper's, or only a part was recorded."""
    part: bool = False
    """True for the recording of a fleet that neither ended nor was seen to its end."""


class VerifyReport(Struct, frozen=True):
    """Results of all checks of all given runs."""

    ok: bool
    runs: tuple[Checked, ...]
    across: tuple[Finding, ...]
    """Findings of the comparisons of the paper's two paths; empty when no run is one of them."""


def command(
    folders: Annotated[list[Path], typer.Argument(help="Run folders with journals; several are compared.")],
    controller: RunController = None,
    behavior: RunBehavior = None,
    sensor: RunSensor = None,
    out: Annotated[
        Path | None, typer.Option(help="Keep the findings here; a second start checks only what is missing.")
    ] = None,
    shard: Annotated[str | None, typer.Option(help="With --out: check only this share of the runs, 3/16.")] = None,
    jobs: Annotated[int, typer.Option(help="With --out: number of parallel processes.")] = 1,
    as_json: Annotated[bool, typer.Option("--json", help="Print all findings as JSON.")] = False,
) -> int:
    """Check the run folders and print the findings; exit code 1 for a broken invariant or a failed property."""
    if out is None and (shard is not None or jobs != 1):
        raise Refused("--shard and --jobs: must go with --out, the folder of the findings")
    own_code = given_files(controller, behavior, sensor)
    if out is not None:
        return _kept(folders, own_code, out, WHOLE if shard is None else parse_shard(shard), jobs, as_json)
    checked: list[Checked] = []
    kept: list[Kept] = []
    try:
        for folder in folders:
            load_code_of_run(folder, own_code)
            one, of_it = check(folder)
            checked.append(one)
            kept += [of_it] if one.shapes and of_it.scenario in PATHS else []
            if not as_json:
                _print(one)
    except KeyboardInterrupt:
        if as_json:
            print_visible(msgspec.json.encode({"runs": checked, "interrupted": True}).decode())
        write_line(f"interrupted: {len(checked)} of {len(folders)} runs are checked", sys.stderr)
        raise
    return _end(checked, kept, as_json)


def _kept(folders: list[Path], own_code: list[OwnFile], out: Path, shard: Shard, jobs: int, as_json: bool) -> int:
    """Check a share of the runs, with the findings kept in `out`; print those of all that are done."""
    for folder in folders:
        load_code_of_run(folder, own_code)
    done = check_share(folders, partial(_checked, own_code), out, shard, jobs)
    checked = [msgspec.convert(one, Checked) for one in done]
    kept = [keep for one in done if one["shapes"] and (keep := msgspec.convert(one["kept"], Kept)).scenario in PATHS]
    if not as_json:
        for one in checked:
            _print(one)
    return _end(checked, kept, as_json)


def _checked(own_code: list[OwnFile], folder: Path) -> tuple[Checked, Kept, str]:
    """Check a run in a process of its own; return also what fails in it."""
    load_code_of_run(folder, own_code)
    one, of_it = check(folder)
    broken = [f"{violation.name} at {violation.at:.3f} s: {violation.text}" for violation in one.broken]
    return one, of_it, "; ".join(broken + [finding.name for finding in one.shapes if finding.status == "fails"])


def _end(checked: list[Checked], kept: list[Kept], as_json: bool) -> int:
    """Print the comparisons of several runs, or everything as JSON; return the exit code."""
    compared = tuple(across_seeds.across(kept)) if kept else ()
    verdict = VerifyReport(not any(map(_faulty, checked)) and not _fails(compared), tuple(checked), compared)
    if as_json:
        print_visible(msgspec.json.encode(verdict).decode())
    elif compared:
        print_visible(f"across {len(kept)} of the paper's paths\n" + "\n".join(map(criteria.line, compared)))
    return 0 if verdict.ok else 1


def check(folder: Path) -> tuple[Checked, Kept]:
    """Return the findings on a run and its data for comparisons.

    Raises Refused when `folder` is no finished run or its journals cannot be re-executed.
    """
    journalled = any((folder / JOURNALS).glob("*.bin"))
    lease = verify(folder) if journalled or not (folder / SUMMARY).is_file() else from_events(folder)
    if not (folder / SUMMARY).is_file():
        raise Refused(f"{folder}: no {SUMMARY}, must be the folder of a run that came to its end")
    run = Run(folder)
    summary = run.summary
    part = summary.outcome == "recorded"
    shapes = () if part else tuple(of_run(run))
    known = Checked(
        str(folder), summary.scenario, summary.seed, lease.journals, lease.happenings, lease.broken, shapes, part
    )
    return known, across_seeds.keep(run)


def from_events(folder: Path) -> JournalVerdict:
    """Return what the events alone show of a run without journals: whether terms went back (I2)."""
    events = event_log.lines(folder)
    broken = tuple(Violation(v.invariant, v.at_s, v.text) for v in event_log.terms_that_went_back(events))
    return JournalVerdict(0, len(events), broken)


def _faulty(one: Checked) -> bool:
    return bool(one.broken) or _fails(one.shapes)


def _fails(findings: Sequence[Finding]) -> bool:
    return any(one.status == "fails" for one in findings)


def _print(one: Checked) -> None:
    for violation in one.broken:
        print_visible(f"{violation.name} broken at {violation.at:.3f} s: {violation.text}")
    names = ", ".join(checker.name for checker in SAFETY)
    if not one.journals:
        print_visible(
            f"{one.folder}: {one.scenario}, seed {one.seed}\n"
            f"{one.happenings} events, I2: {len(one.broken)} violations; "
            "the other invariants need the journals of all processes, which their option --journal DIR keeps"
        )
    else:
        print_visible(
            f"{one.folder}: {one.scenario}, seed {one.seed}\n"
            f"{one.journals} journals, {one.happenings} happenings, {names}: {len(one.broken)} violations"
        )
    if one.part and one.scenario in PAPER:
        print_visible(
            "recorded in part: the shapes of the paper's figures are those of a whole run, and are not checked"
        )
        return
    if not one.shapes:
        print_visible(f"no scenario of the paper ({', '.join(PAPER)}): the shapes of its figures do not apply")
        return
    failed = [finding.name for finding in one.shapes if finding.status == "fails"]
    print_visible("\n".join(map(criteria.line, one.shapes)))
    print_visible(f"{len(one.shapes)} properties of figures 7, 8, 9 and 11: {len(failed)} fail")
