"""Fault model of `lfa fuzz` as data, and schedules drawn from a seed.

Each seed draws its own link conditions and its own few kinds of fault (swarm testing): many schedules with a few
frequent kinds of fault test more than one with all kinds, each rare. Faults occur in the first 4 s, then all heal.
"""

from __future__ import annotations

from random import Random

from msgspec import Struct, structs

from lfa.deploy.fuzz.network import FAIR
from lfa.protocol.lease.term_window import FREE, FRESH, LAST
from lfa.protocol.lease.timing import CLOCK_RATE_ERROR
from lfa.protocol.mission import Profile
from lfa.protocol.transport.link_model import Radio

FAULTS_UNTIL_S = 4.0
DURATION_S = 8.0
WARM_UP_S = 0.6
FAULTS_MEAN = 30
STOPS_MAX = 20
"""Maximum number of an operator's calls in a schedule, which follow on each other and overlap."""
ROSTER_SHARE = 0.3
"""Fraction of schedules with spares, and with operators who let robots join and retire."""
ROSTER_CALLS_MAX = 6
TRICK_SHARE = 0.3
"""Fraction of schedules with tricks: faults that are rare and broad."""
TRICKS_MAX = 3
TRICKS_UNTIL_S = 1.8
"""Time [s] of the last trick: who has promised a made-up term waits 20 heartbeats for its lease (E5)."""
BLACKOUT_LATER_S = 1.2
"""How much later [s] than other tricks a blackout may come: after more elections."""
MADE_UP_TERMS = (LAST, LAST - 1, FREE + FRESH + 1, FREE)
"""Numbers of terms that nobody can have come to (E26)."""
CALM_SHARE = 0.05
"""Fraction of schedules without a fault, in which no leader may step down (L5)."""
LOSSY_SHARE, CALM_LOSS, PAIR_SHARE = 0.7, 0.2, 0.5
"""Fraction of those at the greatest loss that L5 allows for, and of pairs without witness."""
SINGLE_SHARE = 0.05
"""Fraction of schedules with the kill of a leader as only fault, after which the next in the chain leads (L6)."""
LEADER_SHARE = 0.4
"""Share of the faults with one target that are aimed at the leader of that moment."""

MIXED_AT_S = 0.05
"""Time [s] of a fault before the first election."""

LOST_SHARE, LOSSES = 0.3, ("restart", "cut", "pause")
"""Share of the stops of complete agents at whose moment the leader is lost, and how."""

SETTLES_LATER_S = 5.0
"""How much later [s] a team with the profile `auto` has settled after its last fault: its t_remove is that of its
longest lease."""

LEADER = -1
FIRST_AT_S = 1.5
"""Time [s] of the first fault of a systematic schedule: a leader has long led."""


class ScheduledFault(Struct, frozen=True):
    """Fault injected at true time `at` [s]. `targets` are ids; LEADER means the leader of that moment."""

    at: float
    kind: str
    targets: tuple[int, ...] = ()
    duration_s: float = 0.0
    value: float = 0.0


class HeldMessage(Struct, frozen=True):
    """Message `number` of the leases, counted from the first fault: `by_s` [s] later than its link; None: lost."""

    number: int
    by_s: float | None


class Schedule(Struct, frozen=True):
    """Team, link conditions and faults drawn from one seed."""

    seed: int
    robots: int
    witness: bool
    profile: Profile
    gateways_at_world: bool
    rates: dict[int, float]
    faults: tuple[ScheduledFault, ...]
    radio: Radio
    revive_all: bool
    """True if every dead process restarts at the end of the faults; else only as many as a quorum needs."""
    stops: tuple[ScheduledFault, ...] = ()
    """Calls of operators, each at a host: `stop`, `resume`; and the `replay` of an earlier word to a robot."""
    held: tuple[HeldMessage, ...] = ()
    spares: tuple[int, ...] = ()
    """Robots that run and that the mission does not name (E33)."""
    rosters: tuple[ScheduledFault, ...] = ()
    """Calls of operators: `join` of an id, by `value` in the place of another, and `retire` of one."""
    tricks: tuple[ScheduledFault, ...] = ()
    """`blackout` of all processes and of the gateways of some robots, on clocks set wrong by `value` [s]; terms
    `made_up`; a command that echoes a time `ahead` by `value` [s]; a process that speaks another `version`."""
    operator_timeout_s: float | None = None
    """Silence [s] of all operators after which the team stands (E31); `stops` then has calls to `watch`, too."""
    led_s: float = 0.0
    """How much later [s] than usual the faults are over."""

    @property
    def faults_until_s(self) -> float:
        """Time [s] at which all faults heal."""
        return self.led_s + FAULTS_UNTIL_S

    @property
    def duration_s(self) -> float:
        """Time [s] at which a run of the schedule ends."""
        return self.led_s + DURATION_S + (SETTLES_LATER_S if self.profile == "auto" else 0.0)

    @property
    def is_single(self) -> bool:
        """Schedule with perfect links and one fault: the leader is killed, and no message is held back."""
        kinds = [fault.kind for fault in self.faults]
        changed = self.held or self.rosters or self.tricks
        return kinds == ["kill"] and self.faults[0].targets == (LEADER,) and self.radio == FAIR and not changed


KINDS: tuple[str, ...] = (
    "kill",
    "restart",
    "exit",
    "pause",
    "cut",
    "cut_one_way",
    "cut_pair",
    "loss",
    "burst",
    "duplicate",
    "tail",
    "reorder",
    "clock_step",
    "false_hint",
    "hand_over",
    "gateway",
    "witness",
    "mixed",
)
"""Kinds of fault that a schedule may draw.

`burst` is a short total loss, `gateway` and `witness` are a crash with a restart. `clock_step` sets a wall clock wrong
(no other clock can be stepped), and two times in three the process restarts. `mixed` restarts a process with another
profile, or with another version of the mission. Only teams with the profile `auto` also have `lag`: for `duration_s`
each target steps late, by up to `value` [s].
"""


def draw(seed: int) -> Schedule:
    """Draw the schedule of a seed. The link conditions do not depend on the faults."""
    random = Random(seed)
    robots = random.randint(2, 6)
    witness = random.random() < 0.9
    ids = tuple(range(1, robots + 1))
    kinds = [kind for kind in KINDS if random.random() < 0.4 and (witness or kind != "witness")] or ["kill"]
    share = random.random()
    radio = link_conditions(random)
    spares, rosters = _rosters(Random(f"roster-{seed}"), ids)
    tricks = _tricks(Random(f"trick-{seed}"), ids)
    faults = [draw_fault(random, kinds, ids + spares) for _ in range(_count(random, FAULTS_MEAN))]
    if share < CALM_SHARE:
        faults = []
    elif share < CALM_SHARE + SINGLE_SHARE:
        faults, radio = [ScheduledFault(random.uniform(1.5, FAULTS_UNTIL_S), "kill", (LEADER,))], FAIR
    schedule = Schedule(
        seed=seed,
        robots=robots,
        witness=witness,
        profile=random.choices(("std", "fast", "wifi"), (0.7, 0.15, 0.15))[0],
        gateways_at_world=witness and random.random() < 0.5,
        rates={i: clock_rate(random) for i in (*ids, 0, *(-i for i in ids))},
        faults=tuple(sorted(faults, key=_when)),
        radio=radio,
        stops=draw_stops(Random(f"operator-{seed}"), ids),
        spares=spares,
        rosters=rosters,
        tricks=() if share < CALM_SHARE + SINGLE_SHARE else tricks,
        revive_all=random.random() < 0.5,
    )
    return _calm(schedule) if share < CALM_SHARE else schedule


def draw_whole(seed: int) -> Schedule:
    """Draw the schedule of a seed for complete agents: some leaders are lost as an operator stops the fleet."""
    schedule, random = draw(seed), Random(f"whole-{seed}")
    if not schedule.faults or schedule.is_single:
        return schedule
    lost = [
        ScheduledFault(call.at - random.uniform(0.0, 0.02), random.choice(LOSSES), (LEADER,), random.uniform(0.1, 1.0))
        for call in schedule.stops
        if call.kind == "stop" and random.random() < LOST_SHARE
    ]
    return structs.replace(schedule, faults=tuple(sorted([*schedule.faults, *lost], key=_when)))


def _calm(schedule: Schedule) -> Schedule:
    """Return a schedule without a fault, often at a fifth of all messages lost (L5), and of a pair without witness."""
    random = Random(f"calm-{schedule.seed}")
    if random.random() < LOSSY_SHARE:
        schedule = structs.replace(schedule, radio=structs.replace(FAIR, loss=CALM_LOSS))
    if random.random() >= PAIR_SHARE:
        return schedule
    stops = draw_stops(random, (1, 2))
    return structs.replace(
        schedule, robots=2, witness=False, gateways_at_world=False, stops=stops, spares=(), rosters=()
    )


def draw_stops(random: Random, ids: tuple[int, ...]) -> tuple[ScheduledFault, ...]:
    """Return the calls of operators, at hosts among `ids`; stops, resumes and replays come in any order."""
    times = sorted(random.uniform(WARM_UP_S, FAULTS_UNTIL_S) for _ in range(random.randint(0, STOPS_MAX)))
    return tuple(
        ScheduledFault(at, random.choices(("stop", "resume", "replay"), (0.4, 0.3, 0.3))[0], (random.choice(ids),))
        for at in times
    )


def _rosters(random: Random, ids: tuple[int, ...]) -> tuple[tuple[int, ...], tuple[ScheduledFault, ...]]:
    """Return spares and the calls that let robots join and retire; none in most schedules."""
    if random.random() >= ROSTER_SHARE:
        return (), ()
    spares = tuple(range(ids[-1] + 1, ids[-1] + 1 + random.randint(1, 3)))
    times = sorted(random.uniform(WARM_UP_S, FAULTS_UNTIL_S) for _ in range(random.randint(1, ROSTER_CALLS_MAX)))
    calls: list[ScheduledFault] = []
    for at in times:
        kind = random.choices(("join", "retire"), (0.6, 0.4))[0]
        robot = random.choice(spares if kind == "join" and random.random() < 0.8 else (*ids, *spares))
        slot_of = random.choice((0, *ids))
        calls.append(ScheduledFault(at, kind, (robot,), random.uniform(0.3, 1.5), float(slot_of)))
    return spares, tuple(calls)


def _tricks(random: Random, ids: tuple[int, ...]) -> tuple[ScheduledFault, ...]:
    """Return the tricks of a schedule; none in most schedules."""
    if random.random() >= TRICK_SHARE:
        return ()
    times = sorted(random.uniform(WARM_UP_S, TRICKS_UNTIL_S) for _ in range(random.randint(1, TRICKS_MAX)))
    return tuple(draw_trick(random, at, ids) for at in times)


def draw_trick(random: Random, at: float, ids: tuple[int, ...]) -> ScheduledFault:
    """Draw one trick at time `at` [s] on a team of robots `ids`."""
    kind, target = random.choice(("blackout", "blackout", "made_up", "ahead", "version")), random.choice(ids)
    match kind:
        case "blackout":
            share = random.choice((0.0, 0.5, 1.0, 1.0))
            gateways = tuple(i for i in ids if random.random() < share)
            return ScheduledFault(
                at + random.uniform(0.0, BLACKOUT_LATER_S),
                kind,
                gateways,
                random.uniform(0.02, 0.3),
                random.choice((0.0, 0.0, -3600.0)),
            )
        case "made_up":
            return ScheduledFault(at, kind, (target,), value=float(random.randrange(len(MADE_UP_TERMS))))
        case "ahead":
            return ScheduledFault(at, kind, (target,), value=random.choice((0.05, 1.0, 1e9)))
        case _:
            return ScheduledFault(at, kind, (target,), random.uniform(0.5, FAULTS_UNTIL_S))


def _count(random: Random, mean: float) -> int:
    return round(mean * random.uniform(0.8, 1.4))


def _when(fault: ScheduledFault) -> float:
    return fault.at


def clock_rate(random: Random) -> float:
    """Return a clock rate; two in three are the fastest or slowest allowed."""
    return 1.0 + CLOCK_RATE_ERROR * random.choice((-1.0, 1.0, random.uniform(-1.0, 1.0)))


def link_conditions(random: Random) -> Radio:
    """Draw link conditions between processes of different robots."""
    prompt_s = random.choice((0.002, 0.002, 0.005, 0.02))
    loss = random.choice((0.0, 0.0, 0.0, 0.05, 0.2))
    duplication = random.choice((0.0, 0.0, 0.05, 0.3))
    tail = random.choice((0.0, 0.0, 0.02, 0.1))
    tail_mean_s = random.choice((0.02, 0.1, 0.3))
    return structs.replace(
        FAIR,
        jitter_s=prompt_s - FAIR.delay_s,
        loss=loss,
        duplication=duplication,
        duplication_lag_s=2.0 * tail_mean_s,
        tail=tail,
        tail_mean_s=tail_mean_s,
    )


def draw_fault(random: Random, kinds: list[str], ids: tuple[int, ...]) -> ScheduledFault:
    """Draw one fault of one of `kinds` on a team of robots `ids`."""
    at = random.uniform(WARM_UP_S, FAULTS_UNTIL_S)
    kind = random.choice(kinds)
    target = LEADER if random.random() < LEADER_SHARE else random.choice(ids)
    lasts = random.choice((0.0, random.uniform(0.02, 0.2), random.uniform(0.1, 1.5)))
    match kind:
        case "cut" | "cut_one_way":
            side = tuple(i for i in (*ids, 0) if random.random() < 0.5)
            return ScheduledFault(at, kind, side or (target,), random.uniform(0.05, 1.5))
        case "cut_pair":
            return ScheduledFault(at, kind, (target, random.choice((*ids, 0))), random.uniform(0.05, 1.5))
        case "loss":
            return ScheduledFault(at, kind, (), random.uniform(0.1, 1.0), random.uniform(0.1, 0.5))
        case "burst":
            return ScheduledFault(at, kind, (), random.uniform(0.01, 0.15), 1.0)
        case "duplicate":
            return ScheduledFault(at, kind, (), random.uniform(0.1, 1.0), random.uniform(0.1, 0.6))
        case "tail":
            return ScheduledFault(at, kind, (), random.uniform(0.1, 1.0), random.uniform(0.05, 0.5))
        case "reorder":
            return ScheduledFault(at, kind, (), random.uniform(0.1, 1.0), random.uniform(0.1, 0.6))
        case "clock_step":
            return ScheduledFault(at, kind, (target,), lasts, random.choice((-1.0, 1.0)) * random.uniform(1.0, 3600.0))
        case "false_hint":
            observers = tuple(i for i in (*ids, 0) if random.random() < random.choice((0.3, 1.0)))
            return ScheduledFault(at, kind, (target, *observers), lasts, float(random.random() < 0.3))
        case "pause":
            return ScheduledFault(at, kind, (target,), random.uniform(0.05, 1.0), float(random.random() < 0.3))
        case "witness":
            return ScheduledFault(at, kind, (0,), lasts)
        case "mixed":
            early = random.random() < 0.5  # before the first election, which it may win
            at, target = (MIXED_AT_S, random.choice(ids)) if early else (at, target)
            return ScheduledFault(
                at, kind, (target,), random.uniform(0.5, FAULTS_UNTIL_S), float(random.random() < 0.3)
            )
        case _:
            return ScheduledFault(at, kind, (target,), lasts)


def without(schedule: Schedule, *indices: int) -> Schedule:
    """Return the schedule without the faults at `indices`."""
    kept = tuple(fault for index, fault in enumerate(schedule.faults) if index not in indices)
    return structs.replace(schedule, faults=kept)
