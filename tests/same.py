"""Prove that two states of the code behave the same: a table of hashes of what they do, made twice and compared.

`python -m tests.same --out before.table`, change the code, `python -m tests.same --against before.table`. It runs every
shipped scenario in virtual time, plays fuzz seeds on leases alone and on whole agents, and, with `--runs DIR`, replays
the recorded runs in DIR; `--only straight leases` does a share of it. Hashed is what robots say and decide and what a
run comes to; left out is what may differ between two equal runs or with the names in the code: wall clock, paths, size
and schemas of a recording.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import as_completed
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple
from unittest.mock import patch

import msgspec

from lfa.deploy.analysis.verification.checker import Checker
from lfa.deploy.analysis.verification.reexecution import compare
from lfa.deploy.analysis.verification.replay import journals
from lfa.deploy.faults.script import parse_all
from lfa.deploy.fuzz.agent_simulation import AgentSimulation
from lfa.deploy.fuzz.fault_injector import play, play_whole
from lfa.deploy.fuzz.lease_simulation import LeaseSimulation
from lfa.deploy.fuzz.schedules import draw
from lfa.deploy.process.worker_pool import workers
from lfa.deploy.run.simulate import run
from lfa.deploy.version import version_line
from lfa.protocol.runtime.journal import read
from lfa.world.description.load import load, shipped

Task = tuple[str, Callable[..., "list[Row]"], tuple[Any, ...]]
"""Name of what it is about, as in the second column of the table; a function and its arguments."""

EVENTS = "events.jsonl"
SEEDS = (1, 2, 3)
LEASES, WHOLE = "leases", "whole"
"""Names of the two kinds of fuzzing in the table."""
LEASE_SEEDS = 60
WHOLE_SEEDS = 20
WHOLE_CHUNK = 5  # seeds that one worker plays at a time
MADE_BY = "# made by "
OTHERWISE = "otherwise"
"""In place of the hash of a replay that returned otherwise than recorded."""
NO_BEHAVIOUR = ("duration_s", "real_time_factor", "recording", "provenance")
"""What of a summary depends on machine, commit, or docstrings: the recording's size, for its schemas hold them."""


class Row(NamedTuple):
    """One line of the table; no field holds a space."""

    kind: str
    scenario: str
    seed: str
    what: str
    hash: str


class Digest:
    """A hash of values in order, by their fields and never by the names of their classes."""

    def __init__(self, *values: Any) -> None:
        self._sha = sha256()
        self.add(*values)

    def add(self, *values: Any) -> None:
        """Take in `values`."""
        plain = msgspec.to_builtins(values, builtin_types=(bytes,), str_keys=True, order="deterministic")
        self._sha.update(msgspec.msgpack.encode(plain))

    def __str__(self) -> str:
        return self._sha.hexdigest()[:16]


def simulated(name: str, seed: int) -> list[Row]:
    """Run a shipped scenario in virtual time; return the rows of its events, summary and journals."""
    scenario = load(name)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "run"
        ended = run(scenario, seed, folder, parse_all(scenario.mission, scenario.faults, ()))
        kept = journals(folder, "all")
        found = {
            EVENTS: Digest((folder / EVENTS).read_bytes()),
            "summary": _of_summary(msgspec.to_builtins(ended.summary)),
        }
        found["headings"] = Digest(*(read(path)[0] for path in kept))
        found |= {path.name: _of_calls(path) for path in kept}
    return [Row("sim", name, str(seed), what, str(digest)) for what, digest in found.items()]


def _of_summary(facts: dict[str, Any]) -> Digest:
    return Digest({name: value for name, value in facts.items() if name not in NO_BEHAVIOUR})


def _of_calls(path: Path) -> Digest:
    """Return the hash of every call of a journal: its input, and the checksum of its answer."""
    digest = Digest()
    for entry in read(path)[1]:
        digest.add(entry)
    return digest


def fuzzed(whole: bool, first: int, beyond: int) -> list[Row]:
    """Play the seeds from `first` to before `beyond`; return a row for each."""
    name = WHOLE if whole else LEASES
    return [Row("fuzz", name, str(seed), "trace", str(_of_seed(whole, seed))) for seed in range(first, beyond)]


def _of_seed(whole: bool, seed: int) -> Digest:
    """Return the hash of a seed's trace, of all that the checkers hear, of the verdict and of the chance used up."""
    digest, stage, player = Digest(), AgentSimulation if whole else LeaseSimulation, play_whole if whole else play
    listen, heard = stage.listen, _listener(digest)
    with patch.object(stage, "listen", lambda self, checkers: listen(self, [*checkers, heard])):
        played = player(draw(seed), lambda *facts: digest.add("trace", *facts))
    digest.add(played.schedule, played.violations, played.counts, played.elections)
    digest.add(played.simulation.log, repr(played.simulation.random.getstate()))
    return digest


def _listener(digest: Digest) -> Any:
    """Return a checker that finds nothing and gives `digest` all that any checker can hear."""

    def hearing(what: str) -> Callable[..., None]:
        return lambda _, *facts: digest.add(what, *facts)

    heard = [name for name, value in vars(Checker).items() if callable(value) and name[0] != "_" and name != "broken"]
    kind: Any = type("Listener", (Checker,), {name: hearing(name) for name in heard})
    return kind(None)


def replayed(folder: Path) -> list[Row]:
    """Feed the journals of a recorded run to the code of today; return the rows of the comparisons and the events."""
    found = {EVENTS: str(Digest((folder / EVENTS).read_bytes()))}
    for path in journals(folder, "all"):
        comparison = compare(path)
        found[path.name] = str(Digest(comparison)) if comparison.equal else OTHERWISE
        if not comparison.equal:
            print(f"{path}: returns otherwise than recorded: {comparison.difference}", file=sys.stderr)
    return [Row("replay", folder.name, "-", what, digest) for what, digest in found.items()]


def tasks(runs: Path | None, only: Sequence[str]) -> list[Task]:
    """Return all there is to do, the longest first, so that no worker ends with a long one alone.

    `only`: names of scenarios, recorded runs and kinds of fuzzing; empty: all. Raises ValueError for an unknown name.
    """
    folders = sorted(path.parent for path in runs.glob(f"*/{EVENTS}")) if runs else []
    scenarios = sorted(shipped().items(), key=lambda item: -item[1].time_limit_s)
    every: list[Task] = [
        *((name, simulated, (name, seed)) for name, _ in scenarios for seed in SEEDS),
        *((folder.name, replayed, (folder,)) for folder in folders),
        *((WHOLE, fuzzed, (True, first, first + WHOLE_CHUNK)) for first in range(0, WHOLE_SEEDS, WHOLE_CHUNK)),
        (LEASES, fuzzed, (False, 0, LEASE_SEEDS)),
    ]
    names = sorted({name for name, _, _ in every})
    for wanted in only:
        if wanted not in names:
            raise ValueError(f"--only {wanted}: must be one of {', '.join(names)}")
    return [task for task in every if not only or task[0] in only]


def rows(todo: Sequence[Task], jobs: int) -> list[Row]:
    """Do everything with `jobs` processes, telling how far it is; return the sorted table."""
    began, table = time.perf_counter(), list[Row]()
    with workers(jobs) as pool:
        futures = {pool.submit(do, *arguments): (do, arguments) for _, do, arguments in todo}
        for number, future in enumerate(as_completed(futures), start=1):
            do, arguments = futures[future]
            table += future.result()
            said = f"{number}/{len(futures)} {do.__name__} {' '.join(map(str, arguments))}"
            print(f"{time.perf_counter() - began:6.1f} s  {said}", file=sys.stderr, flush=True)
    return sorted(table)


def text(table: list[Row]) -> str:
    """Return the table as text: the version of the code, then one row a line."""
    return f"{MADE_BY}{version_line()}\n" + "".join(
        f"{r.kind:<7} {r.scenario:<15} {r.seed:<4} {r.what:<28} {r.hash}\n" for r in table
    )


def read_table(path: Path) -> tuple[str, list[Row]]:
    """Return the version that made the table at `path`, and its rows."""
    lines = path.read_text().splitlines()
    made_by = lines[0].removeprefix(MADE_BY) if lines[0].startswith(MADE_BY) else "an unnamed version"
    return made_by, [Row(*line.split()) for line in lines if not line.startswith(MADE_BY)]


def differences(before: list[Row], after: list[Row]) -> Iterator[str]:
    """Yield a line for each row that is in one table alone, or has another hash there."""
    was, now = ({row[:4]: row.hash for row in table} for table in (before, after))
    for key in sorted(was.keys() | now.keys()):
        if was.get(key) != now.get(key):
            yield f"{' '.join(key)}: was {was.get(key, 'absent')}, is {now.get(key, 'absent')}"


def main() -> int:
    """Make the table, write or compare it; return 1 when it or a replay differs, 2 for a wrong argument."""
    parser = argparse.ArgumentParser(prog="python -m tests.same", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--out", type=Path, help="write the table here")
    parser.add_argument("--against", type=Path, help="compare with this table, made with the same --runs")
    parser.add_argument("--jobs", type=int, default=2, help="processes at once (2)")
    parser.add_argument("--runs", type=Path, help="a folder of recorded run folders to replay")
    parser.add_argument("--only", nargs="*", default=(), help="scenarios, recorded runs, leases, whole (all)")
    given = parser.parse_args()
    try:
        todo = tasks(given.runs, given.only)
    except ValueError as error:
        parser.error(str(error))
    table = rows(todo, given.jobs)
    if given.out:
        given.out.write_text(text(table))
    otherwise = sum(row.hash == OTHERWISE for row in table)
    replays = sum(row.kind == "replay" and row.what != EVENTS for row in table)
    if replays:
        print(f"{replays - otherwise} of {replays} journals return what was recorded", file=sys.stderr)
    if not given.against:
        print(text(table), end="")
        return 1 if otherwise else 0
    made_by, before = read_table(given.against)
    names = {name for name, _, _ in todo}
    differing = list(differences([row for row in before if row.scenario in names], table))
    if differing:
        print(f"what differs from the table of {made_by}, {len(differing)} of {len(table)} rows:")
    print("\n".join(differing) or f"same: {len(table)} rows")
    return 1 if differing or otherwise else 0


if __name__ == "__main__":
    sys.exit(main())
