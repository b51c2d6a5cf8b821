"""Terms as people read them: small numbers counted in the run, where messages and JSON have the whole number.

A term's number starts from the wall clock in milliseconds, so that it grows over restarts of a fleet.
"""

from __future__ import annotations

from collections.abc import Iterable


class TermCount:
    """Count of the terms of one run or one view: the earliest that is known is 1."""

    def __init__(self, terms: Iterable[int] = ()) -> None:
        self._first = min(terms, default=0)

    def number(self, term: int) -> int:
        """Return the small number of `term`; one earlier than all before begins the count anew."""
        if self._first == 0 or term < self._first:
            self._first = term
        return 1 + term - self._first
