"""What is explored: the models at their sizes, and every mutant with the size at which it must be caught. As tables."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from tests.model import joining, lease_state, lengths, orders, register_state, roster
from tests.model.checker import Model
from tests.model.fleet_stop import fleet_stop
from tests.model.fleet_stop.fleet_stop import FleetStop
from tests.model.joining import JoinModel
from tests.model.lease_core import LeaseCore
from tests.model.lengths import LengthModel
from tests.model.orders import OrderModel
from tests.model.register import Register
from tests.model.roster import RosterModel

STATES_MAX = 4_000_000
"""More than any run below reaches; one that does is not complete, and fails."""


@dataclass(frozen=True)
class Run:
    name: str
    model: Callable[[], Model]
    short: bool
    """A second or two: also part of the ordinary tests."""
    mutant: str = ""


def lease(
    name: str,
    issuers: str,
    act: int,
    deadman: int = 0,
    *,
    gateways: bool,
    delays: bool = False,
    short: bool = False,
    odd: int = 0,
) -> Run:
    terms = tuple(int(digit) - 1 for digit in issuers)
    return Run(
        f"{name}, terms of {issuers}, T_act {act}, D {deadman}",
        lambda: LeaseCore(terms, act, deadman, gateways, delays, odd=odd),
        short=short,
    )


def config(
    name: str,
    robots: int,
    issuers: str,
    changes: int,
    restarts: tuple[int, ...] = (),
    *,
    short: bool = False,
    cold: bool = False,
    head_ties: bool = False,
    floor: bool = False,
    spare: bool = False,
) -> Run:
    terms = tuple(int(digit) - 1 for digit in issuers)
    return Run(
        f"{name}, {robots} robots and witness, terms of {issuers}",
        lambda: Register(robots, terms, changes, restarts, cold, head_ties, floor, spare=spare),
        short,
    )


def stop(
    robots: int, words: tuple[int, ...], gateways: int, agents: int, *, forget: int = 1, short: bool = False
) -> Run:
    said = ", ".join(fleet_stop.WORD_NAMES[word] for word in words)
    count = f"{robots} robots, restarts of {gateways} gateway(s) and {agents} agent(s) of {forget} robot(s)"
    return Run(f"stops: {said}; {count}", lambda: FleetStop(robots, words, gateways, agents, restarting=forget), short)


def rosters(calls: int, *, short: bool = False) -> Run:
    return Run(
        f"rosters: 2 robots, witness and a spare, {calls} joins or retirements", lambda: RosterModel(calls), short
    )


RULES = (
    lease("leases", "12", 2, gateways=False, delays=True, short=True),
    lease("leases, robot 1 of another profile", "12", 1, gateways=False, short=True, odd=1),
    lease("leases, robot 1 of another profile", "121", 1, gateways=False, odd=1),
    lease("fences, robot 1 of another profile", "12", 1, 1, gateways=True, odd=1),
    lease("leases", "11", 2, gateways=False, delays=True),
    lease("leases", "111", 1, gateways=False),
    lease("leases", "112", 1, gateways=False),
    lease("leases", "121", 1, gateways=False),
    lease("leases", "122", 1, gateways=False),
    lease("leases", "123", 1, gateways=False),
    lease("fences", "12", 1, gateways=True, short=True),
    lease("fences", "12", 1, 1, gateways=True, short=True),
    lease("fences", "11", 1, 1, gateways=True),
    lease("fences", "12", 2, 1, gateways=True),
    lease("fences", "112", 1, gateways=True),
    lease("fences", "121", 1, gateways=True),
    lease("fences", "122", 1, gateways=True),
    lease("fences", "123", 1, gateways=True),
    config("one change", 2, "12", 1, short=True),
    config("one change, hand-over", 2, "112", 1),
    config("one change", 3, "12", 1),
    config("two changes, hand-over, head as tie-breaker", 2, "112", 2, head_ties=True),
    config("cold start by full house", 2, "12", 0, cold=True, short=True),
    config("full house and a restart", 2, "12", 0, (0, 1, 2), cold=True, short=True),
    config("one change, any restart", 2, "12", 1, (0, 1, 2)),
    config("one change, any restart with a floor", 2, "12", 1, (0, 1, 2), floor=True),
    config("one change, restart, hand-over", 2, "121", 1, (0,)),
    config("one change, restart with a floor, hand-over", 2, "121", 1, (0,), floor=True),
    config("one change, restart", 3, "12", 1, (0,)),
    config("a spare that leads, one change", 1, "31", 1, short=True, spare=True),
    config("a spare that leads, one change", 2, "41", 1, spare=True),
    stop(1, (1, 2, 3, 4), 1, 1),
    stop(2, (2,), 1, 1, short=True),
    stop(2, (2, 3), 1, 1),
    stop(2, (1, 2), 1, 1),
    stop(2, (2, 3), 1, 1, forget=2),
    stop(3, (2,), 1, 1),
    rosters(1),
    rosters(2),
    Run("orders of operators, 2 robots, 3 terms", lambda: OrderModel(3), short=True),
    Run("lengths: 3 voters, leases of 1 and 3, 2 rounds", lambda: LengthModel(2, 4.0), short=True),
    Run("lengths: one of 3 voters changes, leases of 1 and 3, 3 rounds", lambda: JoinModel(3, 2.0), short=False),
)


def lease_mutant(
    mutant: str, issuers: str, act: int, deadman: int = 0, *, gateways: bool, short: bool = True, odd: int = 0
) -> Run:
    terms = tuple(int(digit) - 1 for digit in issuers)
    build: Callable[[], Model] = lambda: LeaseCore(terms, act, deadman, gateways, mutant=mutant, odd=odd)  # noqa: E731
    return Run(lease_state.MUTANTS[mutant], build, short, mutant)


def config_mutant(
    mutant: str, robots: int, issuers: str, restarts: tuple[int, ...] = (), *, short: bool = True, spare: bool = False
) -> Run:
    terms = tuple(int(digit) - 1 for digit in issuers)
    build: Callable[[], Model] = lambda: Register(robots, terms, 1, restarts, mutant=mutant, spare=spare)  # noqa: E731
    return Run(register_state.MUTANTS[mutant], build, short, mutant)


def stop_mutant(mutant: str, robots: int, words: tuple[int, ...], gateways: int = 0, agents: int = 0) -> Run:
    build: Callable[[], Model] = lambda: FleetStop(robots, words, gateways, agents, mutant)  # noqa: E731
    return Run(fleet_stop.MUTANTS[mutant], build, True, mutant)


def order_mutant(mutant: str) -> Run:
    return Run(orders.MUTANTS[mutant][0], lambda: OrderModel(3, mutant), True, mutant)


def length_mutant(mutant: str) -> Run:
    return Run(lengths.MUTANTS[mutant][0], lambda: LengthModel(2, 4.0, mutant), True, mutant)


def joining_mutant(mutant: str) -> Run:
    return Run(joining.MUTANTS[mutant][0], lambda: JoinModel(3, 2.0, mutant), True, mutant)


def roster_mutant(mutant: str) -> Run:
    return Run(roster.MUTANTS[mutant], lambda: RosterModel(2, mutant), True, mutant)


MUTANTS = (
    lease_mutant("t_grant_short", "12", 2, gateways=False),
    lease_mutant("t_grant_short", "12", 1, 1, gateways=True),
    lease_mutant("lease_from_ack", "12", 2, gateways=False),
    lease_mutant("hint_is_proof", "12", 1, gateways=True),
    lease_mutant("release_unconfirmed", "12", 1, 1, gateways=True),
    lease_mutant("hand_over_unconfirmed", "112", 1, 1, gateways=True),
    lease_mutant("release_given_up_restamp", "112", 1, gateways=False),
    lease_mutant("stamp_after_check", "12", 1, 1, gateways=True),
    lease_mutant("early_restamp", "112", 1, gateways=True),
    lease_mutant("fence_issuer", "112", 1, gateways=True),
    lease_mutant("not_agreed", "12", 1, gateways=False, odd=1),
    lease_mutant("highest_fenced", "123", 1, gateways=True),
    config_mutant("no_joint", 2, "12"),
    config_mutant("same_life", 2, "12", (0, 1, 2)),
    config_mutant("hand_over_writes", 2, "121"),
    config_mutant("full_house_half", 3, "12", (0,), short=False),
    config_mutant("spares_decide", 2, "41", spare=True),
    stop_mutant("stop_not_held", 1, (2,)),
    stop_mutant("replayed_believed", 1, (2, 3, 4)),
    stop_mutant("resume_wins_tie", 1, (1, 2)),
    stop_mutant("starts_certain", 2, (2,), gateways=1, agents=1),
    stop_mutant("any_resume", 2, (1, 2), gateways=1, agents=1),
    stop_mutant("agent_sure", 2, (2,), gateways=1, agents=1),
    stop_mutant("command_first", 1, (1, 2), gateways=1),
    roster_mutant("spares_vote"),
    roster_mutant("retired_returns"),
    roster_mutant("retired_leads"),
    roster_mutant("full_house_of_all"),
    order_mutant("late_order"),
    order_mutant("old_leader"),
    order_mutant("equal_versions"),
    order_mutant("forgets"),
    length_mutant("shortened"),
    length_mutant("asked_for_now"),
    joining_mutant("asks_for_less"),
)
