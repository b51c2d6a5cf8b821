"""Numbers of incarnations: how a process draws its own, and which of two is the later one (rule E23).

A number is drawn from the wall clock and chance, and need not be right: a clock without battery, a step of NTP or one
moment in the future costs one correction: those that remember a later incarnation of a name say so, and the earlier
one goes on under a number after that one. So that there always is one after, numbers are compared on a circle (as
serial numbers in RFC 1982): of two, the one up to half the circle ahead is the later one, 142 years in microseconds. A
stray number farther ahead is an earlier one to everybody, and changes nothing.
"""

from __future__ import annotations

from random import SystemRandom

from lfa.protocol import clock

NUMBERS = 2**53
"""Size of the circle: the numbers that JSON and `header.Count` hold exactly."""
PER_MS = 1000


def drawn_at(wall_ms: int, chance: int) -> int:
    """Return the number of an incarnation that starts at `wall_ms` [ms], in microseconds; `chance` is 0 to 999.

    Chance keeps two starts apart on a machine whose clock begins at the same time with every boot.
    """
    return (wall_ms * PER_MS + chance) % NUMBERS


def drawn() -> int:
    """Return the number of an incarnation that starts now, by this machine's wall clock."""
    return drawn_at(clock.wall_ms(), SystemRandom().randrange(PER_MS))


def after(newest: int, own: int) -> int:
    """Return the next number of a process that has `own`, and was told that `newest` is a later one.

    The last digits of `own` were drawn by chance; they keep it from the number that another incarnation took after
    `newest` and died with before everybody heard of it.
    """
    return (newest + 1 + own % PER_MS) % NUMBERS


def is_later(one: int, other: int) -> bool:
    """Return True if `one` is the number of a later incarnation than `other`."""
    return 0 < (one - other) % NUMBERS < NUMBERS // 2
