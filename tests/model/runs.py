"""What is explored: the models at their sizes, and every mutant with the size at which it must be caught. As tables."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from tests.model import lease_state, register_state
from tests.model.checker import Model
from tests.model.lease_core import LeaseCore
from tests.model.register import Register

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
) -> Run:
    terms = tuple(int(digit) - 1 for digit in issuers)
    return Run(
        f"{name}, {robots} robots and witness, terms of {issuers}",
        lambda: Register(robots, terms, changes, restarts, cold, head_ties, floor),
        short,
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
)


def lease_mutant(
    mutant: str, issuers: str, act: int, deadman: int = 0, *, gateways: bool, short: bool = True, odd: int = 0
) -> Run:
    terms = tuple(int(digit) - 1 for digit in issuers)
    build: Callable[[], Model] = lambda: LeaseCore(terms, act, deadman, gateways, mutant=mutant, odd=odd)  # noqa: E731
    return Run(lease_state.MUTANTS[mutant], build, short, mutant)


def config_mutant(mutant: str, robots: int, issuers: str, restarts: tuple[int, ...] = (), *, short: bool = True) -> Run:
    terms = tuple(int(digit) - 1 for digit in issuers)
    build: Callable[[], Model] = lambda: Register(robots, terms, 1, restarts, mutant=mutant)  # noqa: E731
    return Run(register_state.MUTANTS[mutant], build, short, mutant)


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
)
