"""Guided search: schedules that made a lease do something new are kept, and changed a little.

Coverage is the set of transitions (event, state before and after) that leases have made. Seeds are played in islands of
`ISLAND`, each with a corpus of its own, so that a seed can be played again by playing its island up to it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from random import Random

from msgspec import structs

from lfa.deploy.fuzz.fault_injector import Played
from lfa.deploy.fuzz.lease_processes import Hosts, Transition
from lfa.deploy.fuzz.network import Trace
from lfa.deploy.fuzz.schedules import (
    FAULTS_UNTIL_S,
    KINDS,
    TRICKS_UNTIL_S,
    WARM_UP_S,
    HeldMessage,
    Schedule,
    draw,
    draw_fault,
    draw_trick,
)
from lfa.deploy.fuzz.search.systematic import HOLDS_S, MESSAGES, schedule

ISLAND = 100
DRAWN = 10
"""Number of drawn schedules that an island begins with; as many systematic ones follow."""
FRESH_SHARE = 0.1
"""Share of later schedules that are drawn, so that an island does not end in one corner."""
SHIFT_S = 0.05


def evolve(seeds: range, player: Callable[[Schedule, Trace | None], Played]) -> Iterator[tuple[int, Played]]:
    """Play the schedules of `seeds`, whose islands are played from their beginnings; yield seed and result."""
    first = seeds[0] - seeds[0] % ISLAND
    corpus: list[Schedule] = []
    seen: set[Transition] = set()
    for seed in range(first, seeds[-1] + 1):
        if seed % ISLAND == 0:
            corpus, seen = [], set()
        played = player(_next(seed, corpus), None)
        made = played.simulation.transitions if isinstance(played.simulation, Hosts) else set()
        if not made <= seen:
            seen |= made
            corpus.append(played.schedule)
        if seed in seeds:
            yield seed, played


def _next(seed: int, corpus: list[Schedule]) -> Schedule:
    random, step = Random(f"guided-{seed}"), seed % ISLAND
    if step < DRAWN or not corpus:
        return draw(seed)
    if step < 2 * DRAWN:
        return schedule(seed)
    if random.random() < FRESH_SHARE:
        return draw(seed)
    changed = random.choice(corpus[-ISLAND:])
    for _ in range(random.choice((1, 1, 2, 4))):
        changed = mutated(changed, random.choice(corpus), random)
    return structs.replace(changed, seed=seed)


def mutated(one: Schedule, other: Schedule, random: Random) -> Schedule:
    """Return `one` with one thing changed; faults and link conditions may come from `other`."""
    faults = list(one.faults)
    match random.choice(("drop", "again", "shift", "add", "add", "hold", "hold", "splice", "radio", "ids", "trick")):
        case "drop" if faults:
            faults.pop(random.randrange(len(faults)))
        case "again" if faults:
            fault = random.choice(faults)
            faults.append(structs.replace(fault, at=_within(fault.at + random.uniform(0.0, 4.0 * SHIFT_S))))
        case "shift" if faults:
            n = random.randrange(len(faults))
            faults[n] = structs.replace(faults[n], at=_within(faults[n].at + random.uniform(-SHIFT_S, SHIFT_S)))
        case "add":
            kinds = [kind for kind in KINDS if one.witness or kind != "witness"]
            faults.append(draw_fault(random, kinds, tuple(range(1, one.robots + 1))))
        case "hold":
            held = HeldMessage(random.randrange(2 * MESSAGES), random.choice(HOLDS_S))
            one = structs.replace(one, held=(*one.held[-2:], held))
        case "splice":
            faults += [fault for fault in other.faults if all(target <= one.robots for target in fault.targets)]
        case "trick":
            at = random.uniform(WARM_UP_S, TRICKS_UNTIL_S)
            trick = draw_trick(random, at, tuple(range(1, one.robots + 1)))
            one = structs.replace(one, tricks=(*one.tricks[-1:], trick))
        case "radio":
            one = structs.replace(one, radio=other.radio)
        case _:
            one = structs.replace(one, revive_all=not one.revive_all, rates=draw(random.randrange(1000)).rates)
    return structs.replace(one, faults=tuple(sorted(faults, key=lambda fault: fault.at)))


def _within(at: float) -> float:
    return min(max(at, WARM_UP_S), FAULTS_UNTIL_S)
