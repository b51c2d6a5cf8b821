"""`Refused`, the one exception for invalid input; it is shown to the user as one line."""

from __future__ import annotations


class Refused(ValueError):
    """Invalid value given by a person; the text is one line: what is wrong, where, and what would be right."""
