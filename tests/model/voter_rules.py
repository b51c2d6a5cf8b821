"""What a voter may promise and grant (E3, E4, E15, E16), as pure functions of small numbers.

The timed model decides with these; `refinement.py` shows that `lfa.protocol.lease.acceptor.Acceptor` decides the same
in every state that it can reach. Terms and ids are small integers; 0 is "no term", holder None is "not bound".
"""

from __future__ import annotations

from collections.abc import Container


def may_promise(
    term: int, asker: int, *, promised: int, released: int, bond_holder: int | None, holder_gone: bool
) -> bool:
    return term >= promised and term > released and (bond_holder is None or bond_holder == asker or holder_gone)


def may_grant(
    term: int,
    holder: int,
    sender: int,
    fenced: Container[int],
    *,
    promised: int,
    released: int,
    bond_term: int,
    bond_holder: int | None,
) -> bool:
    """`bond_*` are those of a bond still in force."""
    if term < promised or term <= released:
        return False
    return bond_holder is None or bond_holder in (holder, sender) or bond_term in fenced
