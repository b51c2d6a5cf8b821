"""Schedules of teams with the profile `auto` whose processes lag, for `lfa fuzz --lagging` (E36)."""

from __future__ import annotations

from operator import attrgetter
from random import Random

from msgspec import structs

from lfa.deploy.fuzz.schedules import FAULTS_UNTIL_S, LEADER, WARM_UP_S, Schedule, ScheduledFault, draw

LED_S = ((0.0, 0.0), (10.0, 13.0), (20.0, 24.0))
"""Time [s] for which a team that lags has run without a fault: so it asks for its longest lease, or for a shorter one,
or is about to."""
LAGS_MAX = 6
LAG_S = (0.02, 0.3)
"""Longest step [s] of a process that lags: up to what the longest lease bears, and more than the shortest does."""


def draw_lagging(seed: int) -> Schedule:
    """Draw the schedule of a seed for a team with the profile `auto`, whose processes lag, among its other faults."""
    schedule, random = draw(seed), Random(f"lag-{seed}")
    ids, led_s = (0, *range(1, schedule.robots + 1)), random.uniform(*random.choice(LED_S))
    lags = [
        ScheduledFault(
            random.uniform(WARM_UP_S, FAULTS_UNTIL_S),
            "lag",
            random.choice((ids, ids, tuple(i for i in ids if random.random() < 0.5), (LEADER,))),
            random.uniform(0.2, FAULTS_UNTIL_S),
            random.uniform(*LAG_S),
        )
        for _ in range(random.randint(1, LAGS_MAX))
    ]
    lost = [
        ScheduledFault(
            lag.at + random.uniform(0.0, 0.6),
            random.choice(("cut", "cut_one_way", "pause")),
            (LEADER,),
            random.uniform(0.3, 2.0),
        )
        for lag in lags
    ]
    kept = [fault for fault in schedule.faults if random.random() < random.choice((0.0, 0.3, 1.0))]
    drawn = [*kept, *lags, *random.sample(lost, random.randint(0, len(lost)))]
    return structs.replace(
        schedule,
        profile="auto",
        led_s=led_s,
        faults=_later(tuple(sorted(drawn, key=attrgetter("at"))), led_s),
        stops=_later(schedule.stops, led_s),
        rosters=_later(schedule.rosters, led_s),
        tricks=_later(schedule.tricks, led_s),
    )


def _later(faults: tuple[ScheduledFault, ...], by_s: float) -> tuple[ScheduledFault, ...]:
    return tuple(structs.replace(fault, at=fault.at + by_s) for fault in faults)
