"""Share of a campaign: `3/16` is the third of sixteen. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, TypeVar

from lfa.protocol.errors import Refused
from lfa.protocol.names import whole_number

Work = TypeVar("Work")
SHARDS_MAX = 100_000


class Shard(NamedTuple):
    """Share `number` of `of` equal ones, counted from 1."""

    number: int
    of: int

    def __str__(self) -> str:
        return f"{self.number}/{self.of}"

    def share(self, work: Sequence[Work]) -> list[Work]:
        """Return this share: every `of`-th item, so that neighbours, which take alike, spread over all shares."""
        return list(work[self.number - 1 :: self.of])


WHOLE = Shard(1, 1)


def parse_shard(text: str) -> Shard:
    """Return the share named by a text such as `3/16`. Raises Refused."""
    first, slash, last = text.partition("/")
    number, of = whole_number(first), whole_number(last)
    if not slash or number is None or of is None or not 1 <= number <= of <= SHARDS_MAX:
        raise Refused(f"--shard {text}: must be like 3/16, from 1/16 to 16/16")
    return Shard(number, of)
