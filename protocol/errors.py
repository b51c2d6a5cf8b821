"""`Refused`: the one exception for bad input, shown to the user as one line."""

from __future__ import annotations


class Refused(ValueError):
    """A value given by a person that cannot be obeyed; the text is one line: what, where, what would be right."""
