"""`Refused`, the one exception for invalid input; it is shown to the user as one line for each mistake."""

from __future__ import annotations


class Refused(ValueError):
    """Invalid value given by a person; the text is one line: what is wrong, where, and what would be right."""

    @property
    def lines(self) -> tuple[str, ...]:
        """One line for each mistake: several for a file with several, else the text."""
        return (str(self),)
