"""Schedules of the fleet stop alone, drawn from a seed: operators, what they say, and the faults meanwhile.

They are shorter than those of the leases, which have to settle: words and faults come in the first 1.5 s.
"""

from __future__ import annotations

from operator import attrgetter
from random import Random

from msgspec import structs

from lfa.deploy.fuzz.schedules import LEADER, Schedule, ScheduledFault, clock_rate, draw_fault, link_conditions

BEGIN_S, FAULTS_UNTIL_S, DURATION_S = 0.15, 1.5, 2.2
"""Times [s] of the first fault, of the end of all, and of the run."""
FAULTS_MAX, CALLS_MAX, WATCHES_MAX = 12, 6, 3
KINDS: tuple[str, ...] = (
    "kill",
    "restart",
    "gateway",
    "reboot",
    "pause",
    "hand_over",
    "cut",
    "cut_one_way",
    "cut_pair",
    "loss",
    "burst",
    "duplicate",
    "tail",
    "reorder",
)
"""Kinds of fault that such a schedule may draw: those of the leases, without what only leases notice; `reboot`
restarts the agent and the gateway of a robot."""
AT_STOP, AT_STOP_SHARE = ("restart", "gateway", "reboot", "cut", "pause", "hand_over"), 0.3
"""What befalls the leader, or some robot, at the moment of a stop, and the share of stops at which it does."""
ALONE_SHARE, ALONE_S = 0.3, 0.7
"""Share of the schedules in which a robot reboots while it is cut off, for so long [s] after that, and hears old
words."""
TIMEOUT_SHARE, TIMEOUT_S = 0.3, (0.1, 0.6)
"""Share of the teams that stand without an operator (E31), and the silence [s] after which they do."""


def draw_stop_schedule(seed: int) -> Schedule:
    """Draw the schedule of a seed; the same seed gives the same one."""
    random = Random(f"fleet-stop-{seed}")
    ids = tuple(range(1, random.randint(1, 5) + 1))
    kinds = [kind for kind in KINDS if random.random() < 0.5] or ["reboot"]
    radio = link_conditions(random)
    faults = [_fault(random, kinds, ids) for _ in range(random.randint(0, FAULTS_MAX))]
    timeout_s = random.uniform(*TIMEOUT_S) if random.random() < TIMEOUT_SHARE else None
    calls = [_call(random, ids) for _ in range(random.randint(1, CALLS_MAX))]
    if timeout_s is not None:
        calls += [_watch(random, ids) for _ in range(random.randint(1, WATCHES_MAX))]
    for call in [call for call in calls if call.kind == "stop" and random.random() < AT_STOP_SHARE]:
        target, lasts_s = random.choice((LEADER, random.choice(ids))), random.uniform(0.05, 1.0)
        at = call.at + random.uniform(-0.02, 0.05)
        faults.append(ScheduledFault(at, random.choice(AT_STOP), (target,), lasts_s))
    if random.random() < ALONE_SHARE:
        robot, at, lasts_s = random.choice(ids), random.uniform(BEGIN_S, 0.6 * FAULTS_UNTIL_S), random.uniform(0.0, 0.3)
        faults.append(ScheduledFault(at, "reboot", (robot,), lasts_s))
        faults.append(ScheduledFault(at, "cut", (robot,), lasts_s + ALONE_S))
        calls += [ScheduledFault(random.uniform(0.0, at), kind, (random.choice(ids),)) for kind in ("stop", "resume")]
        calls.append(ScheduledFault(at + lasts_s + random.uniform(0.0, ALONE_S), "replay", (robot,)))
    return Schedule(
        seed=seed,
        robots=len(ids),
        witness=False,
        profile=random.choice(("fast", "fast", "std")),
        gateways_at_world=random.random() < 0.3,
        rates={i: clock_rate(random) for i in (*ids, *(-i for i in ids))},
        faults=tuple(sorted(faults, key=attrgetter("at"))),
        radio=radio,
        stops=tuple(sorted(calls, key=attrgetter("at"))),
        operator_timeout_s=timeout_s,
        revive_all=True,
    )


def _fault(random: Random, kinds: list[str], ids: tuple[int, ...]) -> ScheduledFault:
    fault = draw_fault(random, [random.choice(kinds)], ids)
    return structs.replace(fault, at=random.uniform(BEGIN_S, FAULTS_UNTIL_S))


def _call(random: Random, ids: tuple[int, ...]) -> ScheduledFault:
    """Return a call of an operator at the host of some robot, or the replay of all words of before to it."""
    kind = random.choices(("stop", "resume", "replay"), (0.4, 0.3, 0.3))[0]
    return ScheduledFault(random.uniform(BEGIN_S, FAULTS_UNTIL_S), kind, (random.choice(ids),))


def _watch(random: Random, ids: tuple[int, ...]) -> ScheduledFault:
    at = random.uniform(0.0, FAULTS_UNTIL_S)
    return ScheduledFault(at, "watch", (random.choice(ids),), random.uniform(0.1, 1.0))
