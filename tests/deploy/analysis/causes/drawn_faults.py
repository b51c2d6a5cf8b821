"""Faults drawn from a seed, injected into short runs in virtual time; `lfa why` must name each. `make why` prints all.

The lines that announce the fault are not read by `lfa why`, so it is named by its traces alone.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from random import Random

from msgspec import Struct

from lfa.deploy.analysis.causes.command import Causes, lines, roots, why
from lfa.deploy.analysis.causes.fact import FAILURES, Fact
from lfa.deploy.faults.script import parse_all
from lfa.deploy.run.simulate import run
from lfa.world.description.load import load

DRAWN = 40
SHARE_MIN = 0.95
ROBOTS, LIMIT_S = 4, 11.0


class DrawnFault(Struct, frozen=True):
    """A fault, and the fact that must be named as its root."""

    seed: int
    fault: str
    kind: str
    place: str
    """Name that must be among the places of the root; empty: any."""
    other: str = ""


def drawn(seed: int) -> DrawnFault:
    """Return the fault number `seed`; the kinds take turns, all else is chance."""
    chance = Random(f"why-{seed}")
    kinds = tuple(_DRAW)
    at_s = round(chance.uniform(3.0, 5.0), 2)
    robot = chance.choice((1, 1, *range(2, ROBOTS + 1)))
    words, kind, other = _DRAW[kinds[seed % len(kinds)]](robot, chance)
    return DrawnFault(
        seed, words.replace("AT", f"at {at_s} s"), kind, f"robot{robot}" if kind != "lossy" else "", other
    )


def _kill(robot: int, _: Random) -> tuple[str, str, str]:
    return f"kill {robot} AT", "died", ""


def _stop(robot: int, chance: Random) -> tuple[str, str, str]:
    return f"stop {robot} AT for {chance.uniform(0.6, 3.0):.1f} s", "stalled", ""


def _stop_for_good(robot: int, _: Random) -> tuple[str, str, str]:
    return f"stop {robot} AT", "stalled", ""


def _terminate(robot: int, _: Random) -> tuple[str, str, str]:
    return f"terminate {robot} AT", "left", ""


def _cut(robot: int, chance: Random) -> tuple[str, str, str]:
    return f"cut {robot} AT for {chance.uniform(1.5, 4.0):.1f} s", "cut", ""


def _cut_pair(robot: int, chance: Random) -> tuple[str, str, str]:
    other = chance.choice([n for n in range(1, ROBOTS + 1) if n != robot])
    way = chance.choice("->")
    return f"cut {robot}{way}{other} AT for {chance.uniform(3.0, 5.0):.1f} s", "cut", ""


def _loss(_: int, chance: Random) -> tuple[str, str, str]:
    return f"loss {chance.uniform(0.15, 0.7):.2f} AT for {chance.uniform(2.0, 4.0):.1f} s", "lossy", ""


def _hang(robot: int, chance: Random) -> tuple[str, str, str]:
    part = chance.choice(("driver", "localization", "scanner"))
    return f"hang {part} {robot} AT for {chance.uniform(2.0, 5.0):.1f} s", "hardware silent", part


_DRAW: dict[str, Callable[[int, Random], tuple[str, str, str]]] = {
    "kill": _kill,
    "stop": _stop,
    "terminate": _terminate,
    "cut": _cut,
    "hang": _hang,
    "cut of a pair": _cut_pair,
    "loss": _loss,
    "stop for good": _stop_for_good,
}


def explained(fault: DrawnFault, folder: Path) -> Causes:
    """Run the team with the fault, write the run to `folder`, and return what `lfa why` finds."""
    scenario = load("straight", [f"time_limit_s={LIMIT_S}"], ROBOTS)
    ended = run(scenario, fault.seed, folder, parse_all(scenario.mission, (), [fault.fault]))
    return why(ended.folder)


def objections(fault: DrawnFault, found: Causes) -> list[str]:
    """Return why the causes found are not right; empty if the fault is named, and no other failure is."""
    named = roots(found)
    wrong = [fact for fact in named if fact.kind in FAILURES and not _is(fault, fact)]
    missing = [] if any(_is(fault, fact) for fact in named) else ["the fault is not named"]
    return missing + [f"named without being there: {fact.text} at {fact.at_s:.2f} s" for fact in wrong]


def _is(fault: DrawnFault, fact: Fact) -> bool:
    return (
        fact.kind == fault.kind
        and (not fault.place or fault.place in fact.places)
        and (not fault.other or fault.other == fact.other)
    )


def main() -> None:
    """Explain `DRAWN` faults and print the share that is named."""
    seeds = range(int(sys.argv[1]), int(sys.argv[2])) if len(sys.argv) > 2 else range(DRAWN)
    right = 0
    for seed in seeds:
        fault = drawn(seed)
        with tempfile.TemporaryDirectory() as place:
            found = explained(fault, Path(place) / "run")
        wrong = objections(fault, found)
        right += not wrong
        print(f"{seed:3} {fault.fault:<44} {'named' if not wrong else '; '.join(wrong)}", flush=True)
        if wrong or "-v" in sys.argv:
            print("\n".join(f"      {line}" for line in lines(found)), flush=True)
    print(f"{right} of {len(seeds)} faults are named by lfa why")
    sys.exit(0 if right >= SHARE_MIN * len(seeds) else 1)


if __name__ == "__main__":
    main()
