"""Systematic search: schedules of few faults and few delayed messages, in the order of how few (delay-bounded).

Three robots and the witness on perfect links and the worst clocks; a leader holds its lease, then one or two faults end
its term, so a schedule goes through two terms or three. Up to three messages after the first fault are late or lost.
Within a level, schedules are taken at equal distances, so a search that ends early has seen all of its kinds. In every
second one operators stop and resume the team. Emmi, Qadeer, Rakamaric, Delay-bounded scheduling (2011).
"""

from __future__ import annotations

from itertools import accumulate, product
from math import comb, gcd
from random import Random

from lfa.deploy.fuzz.network import FAIR
from lfa.deploy.fuzz.schedules import FIRST_AT_S, LEADER, HeldMessage, Schedule, ScheduledFault, draw_stops
from lfa.protocol.lease.timing import CLOCK_RATE_ERROR

ROBOTS = 3
FAULTS_MAX, DELAYS_MAX = 2, 3
MESSAGES = 60
"""Number of messages after the first fault that may be delayed: those of an election and of the rounds after it."""
HOLDS_S: tuple[float | None, ...] = (0.03, 0.2, None)
"""How late [s] a message comes: behind its round, or behind its lease; None: lost."""
OFFSETS_S = (0.01, 0.06, 0.2, 0.4)
"""Times [s] from the first fault to the second; the third is T_act without a heartbeat: a lease is about to end."""
SECOND, LAST = 2, 3

#         kind           targets        duration value
FAULTS: tuple[tuple[str, tuple[int, ...], float, float], ...] = (
    ("kill",        (LEADER,),      0.0,  0.0),
    ("kill",        (SECOND,),      0.0,  0.0),
    ("restart",     (LEADER,),      0.02, 0.0),
    ("restart",     (LEADER,),      0.3,  0.0),
    ("restart",     (SECOND,),      0.1,  0.0),
    ("exit",        (LEADER,),      0.1,  0.0),
    ("exit",        (SECOND,),      0.1,  0.0),
    ("pause",       (LEADER,),      0.1,  0.0),
    ("pause",       (LEADER,),      0.5,  0.0),
    ("pause",       (LEADER,),      0.5,  1.0),
    ("pause",       (SECOND,),      0.5,  0.0),
    ("cut",         (LEADER,),      0.5,  0.0),
    ("cut",         (LEADER, 0),    0.5,  0.0),
    ("cut_one_way", (LEADER,),      0.5,  0.0),
    ("cut_one_way", (SECOND, LAST), 0.5,  0.0),
    ("cut_pair",    (LEADER, 0),    0.5,  0.0),
    ("hand_over",   (LEADER,),      0.0,  0.0),
    ("gateway",     (LEADER,),      0.1,  0.0),
    ("gateway",     (SECOND,),      0.1,  0.0),
    ("witness",     (0,),           0.1,  0.0),
    ("clock_step",  (LEADER,),      0.1, -900.0),
    ("mixed",       (SECOND,),      0.8,  0.0),
    ("false_hint",  (LEADER, SECOND, LAST, 0), 0.0, 1.0),
    ("burst",       (),             0.1,  1.0),
)  # fmt: skip


def level_size(faults: int, delays: int) -> int:
    """Return the number of schedules with so many faults and delays."""
    of_faults = len(FAULTS) ** faults * len(OFFSETS_S) ** max(0, faults - 1)
    return int(of_faults * comb(MESSAGES, delays) * len(HOLDS_S) ** delays)


LEVELS: tuple[tuple[int, int], ...] = tuple(
    sorted(product(range(FAULTS_MAX + 1), range(DELAYS_MAX + 1)), key=lambda level: (sum(level), level))
)
"""Levels (faults, delays), the fewest deviations first. The first three are searched whole, the others in turn."""
TURNS = (
    (1, 1), (2, 0), (1, 2), (1, 1), (2, 1), (0, 2), (1, 1), (2, 0), (0, 3), (1, 2), (1, 1), (2, 1), (1, 3), (2, 0),
    (2, 2), (2, 3),
)  # fmt: skip
"""Levels of the schedules after those: small levels more often, for of a large one a search sees little anyway."""
WORST_RATES = {1: 1.0 - CLOCK_RATE_ERROR} | dict.fromkeys((0, SECOND, LAST), 1.0 + CLOCK_RATE_ERROR)
"""Clocks on which leases last longest and bonds end first, with robot 1 as the first leader."""
WHOLE = 3
_WHOLE_SIZES = tuple(accumulate(level_size(*level) for level in LEVELS[:WHOLE]))
SCHEDULES = sum(level_size(*level) for level in LEVELS)


def place(number: int) -> tuple[tuple[int, int], int]:
    """Return the level of schedule `number`, and its place in it."""
    for level, end in zip(LEVELS[:WHOLE], _WHOLE_SIZES, strict=True):
        if number < end:
            return level, number - end + level_size(*level)
    rounds, turn = divmod(number - _WHOLE_SIZES[-1], len(TURNS))
    level = TURNS[turn]
    step = rounds * TURNS.count(level) + TURNS[:turn].count(level)
    return level, step % level_size(*level)


def schedule(number: int) -> Schedule:
    """Return the schedule of that number; the same number is the same schedule everywhere."""
    (faults, delays), step = place(number)
    size = level_size(faults, delays)
    rest = step * _stride(size) % size
    chosen, at = [], FIRST_AT_S
    for n in range(faults):
        rest, which = divmod(rest, len(FAULTS))
        if n:
            rest, offset = divmod(rest, len(OFFSETS_S))
            at += OFFSETS_S[offset]
        kind, targets, duration_s, value = FAULTS[which]
        chosen.append(ScheduledFault(at, kind, targets, duration_s, value))
    rest, combination = divmod(rest, comb(MESSAGES, delays))
    held = []
    for message in _combination(combination, delays):
        rest, hold = divmod(rest, len(HOLDS_S))
        held.append(HeldMessage(message, HOLDS_S[hold]))
    stops = draw_stops(Random(f"operator-{number}"), tuple(range(1, ROBOTS + 1))) if number % 2 else ()
    return Schedule(
        seed=number, robots=ROBOTS, witness=True, profile="std", gateways_at_world=False, rates=WORST_RATES,
        faults=tuple(chosen), radio=FAIR, stops=stops, revive_all=True, held=tuple(held),
    )  # fmt: skip


def covered(numbers: range) -> list[str]:
    """Return how many schedules of each level a search has covered, a line each."""
    counts: dict[tuple[int, int], set[int]] = {}
    for number in numbers:
        level, step = place(number)
        counts.setdefault(level, set()).add(step)
    return [
        f"{faults} faults, {delays} delays: {len(steps)} of {level_size(faults, delays)}"
        for (faults, delays), steps in counts.items()
    ]


def _stride(size: int) -> int:
    """Return a step that visits all of `size` places, neighbours in time far apart: about the golden section."""
    step = max(1, round(size * 0.6180339887))
    while gcd(step, size) != 1:
        step += 1
    return step


def _combination(number: int, count: int) -> list[int]:
    """Return the `number`-th set of `count` messages (combinatorial number system)."""
    found = []
    for k in range(count, 0, -1):
        message = k - 1
        while comb(message + 1, k) <= number:
            message += 1
        number -= comb(message, k)
        found.append(message)
    return found
