"""Planted bugs of the protocol, each in a schedule of `lfa fuzz` that breaks an invariant: is the broken rule named?

The rules come from what was observed, by the code that `lfa fuzz` reports with; it knows nothing of the planted bug.
`make why` prints all, behind the drawn faults; `--from 100` looks for other schedules of each bug, from that seed on.
"""

from __future__ import annotations

import argparse
import sys

import pytest

from lfa.deploy.analysis.causes.broken_rules import lines
from lfa.deploy.analysis.causes.fact_log import BrokenRule
from lfa.deploy.fuzz.search.searches import Kind, Search
from tests.protocol.lease.planted import PLANTED, Bug

SHARE_MIN = 0.95
SEEDS = 60
"""Schedules in which another one that shows a bug is looked for."""
SHOWN_IN: dict[str, tuple[str, int]] = {
    "lease counted from the grant, not from the asking": ("E2", 20),
    "the wall clock in lease arithmetic": ("E2", 34),
    "check, pause, act: the age of stamps is not checked": ("E12", 2),
    "a time that is still to come is believed": ("E12", 12),
    "the end of a lease is not told": ("E7", 2),
    "the end of a lease is not noticed": ("E7", 2),
    "leadership announced with the first grant": ("E2", 16),
    "an amnesiac votes after its silence": ("E18", 2),
    "terms begin again at a restart": ("E1", 2),
    "voters change without a joint config": ("E17", 2),
    "a refused candidate raises the promise": ("E3", 2),
    "a new term with every asking": ("E6", 0),
    "a deaf leader goes on asking": ("E7", 2),
    "equal ranks: everybody stands at once": ("E6", 54),
    "a hint taken as proof": ("E15", 2),
    "a released term is granted again": ("E4", 16),
    "out of the chain after four silent heartbeats": ("E8", 155),
    "a bond of half the lease": ("E2", 2),
    "PREPARE and PROPOSE ignore a live grant": ("E3", 2),
    "a restarted process votes at once": ("E1", 2),
    "clocks 25 % wrong against an eps of 0.1 %": ("E2", 22),
    "a hand-over writes a new config without phase 1": ("E16", 19),
    "a full house that is not joint with all of it": ("E18", 1),
    "RELEASE before the gateway's confirmation": ("E4", 485),
    "RELEASE of a raised term that is given up": ("E4", 91),
    "acting under a raised term before its quorum": ("E10", 2),
    "rounds that restart": ("E16", 19),
    "the stamp is read after the lease check": ("E12", 47),
    "a full house of a majority": ("E18", 0),
    "a gateway without the term check": ("E12", 2),
    "a gateway that is open at its start": ("E13", 11),
    "FENCED answered without fencing": ("E11", 0),
    "a voter promises up to a released term": ("E4", 31),
    "a replaced life makes a full house": ("E18", 65),
    "nothing is agreed: whoever has another profile or mission votes": ("E25", 4),
    "any term is believed, also the last one": ("E26", 0),
    "the chain forgets its order": ("E8", 9),
    "an earlier incarnation is dropped in silence": ("E23", 4),
    "the highest number is the latest": ("E23", 4),
    "a stop is not held": ("E28", 0),
    "late and replayed words of a stop are believed": ("E29", 47),
    "a gateway that starts may go": ("E30", 1),
    "an agent that starts knows what holds": ("E30", 1),
    "an agent lifts a stop": ("E30", 7),
    "spares vote like others": ("E33", 31),
    "whoever says HELLO is taken in": ("E33", 0),
    "a full house leaves out the spare that asks for it": ("E33", 47),
    "a retired robot stands for election": ("E34", 31),
    "messages of any version are read": ("E35", 6),
}
"""Bugs of which a schedule breaks an invariant: the planted rule, and the seed of such a schedule."""
SHOWN_BY_STOPS: dict[str, tuple[str, int]] = {
    "any resume lets a gateway go that has just started": ("E30", 10),
    "a replayed order shows that an operator is there": ("E31", 0),
}
"""The same of bugs that schedules of the fleet stop alone find."""
SHOWN: tuple[Bug, ...] = tuple(bug for bug in PLANTED if bug.what in SHOWN_IN or bug.what in SHOWN_BY_STOPS)


def search_of(bug: Bug) -> Search:
    """Return the search whose schedules show a bug."""
    kind: Kind = "stops" if bug.what in SHOWN_BY_STOPS else "drawn"
    return Search(kind)


def shown_in(bug: Bug) -> tuple[str, int]:
    """Return the rule that a bug breaks, and the seed of a schedule that shows it."""
    return (SHOWN_IN | SHOWN_BY_STOPS)[bug.what]


def named(bug: Bug, seed: int) -> BrokenRule | None:
    """Play a schedule with the bug; return what the report names as broken."""
    search = search_of(bug)
    with pytest.MonkeyPatch.context() as patch:
        bug.plant(patch)
        return search.player(search.schedule(seed), None).broken


def other_seed(bug: Bug, first: int) -> int | None:
    """Return the first seed from `first` on whose schedule breaks an invariant."""
    with pytest.MonkeyPatch.context() as patch:
        bug.plant(patch)
        played = search_of(bug).played(range(first, first + SEEDS))
        return next((seed for seed, one in played if one.violations), None)


def main() -> None:
    """Print a row a bug, and the share of those whose rule is named, beside its bar."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--from", type=int, dest="first", help="first seed of other schedules than those of the table")
    parser.add_argument("-v", action="store_true", dest="verbose", help="print the chains of causes")
    arguments = parser.parse_args()
    right = shown = 0
    for bug in SHOWN:
        rule, known = shown_in(bug)
        seed = known if arguments.first is None else other_seed(bug, arguments.first)
        if seed is None:
            print(f"{rule:>4} {bug.what:<64} in none of {SEEDS} schedules", flush=True)
            continue
        found, shown = named(bug, seed), shown + 1
        rules = () if found is None else found.rules
        right += rule in rules
        answer = "named" if rule in rules else "NOT NAMED"
        fell = "" if found is None else f"by {found.steps[-1].text.partition(':')[0]}, "
        print(f"{rule:>4} {bug.what:<64} {' '.join(rules) or '-':<8} {answer}, {fell}seed {seed}", flush=True)
        if arguments.verbose and found is not None:
            print("\n".join(f"      {line}" for line in lines(found)), flush=True)
    fine = right >= SHARE_MIN * shown
    print(f"{right} of {shown} planted bugs: {right / shown:.2f} (bar {SHARE_MIN}) {'ok' if fine else 'FAILS'}")
    sys.exit(0 if fine else 1)


if __name__ == "__main__":
    main()
