"""Cases of a bench as a campaign: measured in shares, resumed, and merged."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fnmatch import fnmatchcase
from functools import partial
from pathlib import Path

import msgspec
from msgspec import Struct

from lfa.deploy.bench.harness.rows import BenchRow, Case, CasePart, Quantity, combined, measured, row
from lfa.deploy.campaign.combine import Combined
from lfa.deploy.campaign.items import Item, ItemResult, name_of
from lfa.deploy.campaign.shard import WHOLE, Shard
from lfa.deploy.campaign.work import campaign_of, do_share

KIND = "bench"


class Keep(Struct, frozen=True):
    """Folder in which the results of a bench are kept, and the share that is measured now."""

    out: Path
    shard: Shard = WHOLE


class CaseFacts(Struct, frozen=True):
    """What a merge needs of a case: its rows, and the number of its parts."""

    name: str
    quantities: tuple[Quantity, ...]
    parts: int


def measured_or_kept(
    bench: str, cases: Sequence[Case], jobs: int, glob: str, keep: Keep | None
) -> Iterator[list[BenchRow]]:
    """Yield the rows of the cases as `measured` does; with `keep`, of those whose parts are all there."""
    if keep is None:
        yield from measured(cases, jobs, glob)
        return
    items = [_item(bench, case, part) for case in cases for part in _parts(case)]
    facts = [CaseFacts(case.name, case.quantities, len(_parts(case))) for case in cases]
    campaign = campaign_of(KIND, f"lfa bench {bench}", items, msgspec.to_builtins(facts))
    kept, _ = do_share(keep.out, campaign, items, keep.shard, jobs, "parts")
    for rows in rows_of(Combined(campaign, {result.name: result for result in kept.results()})):
        yield [one for one in rows if fnmatchcase(one.name, glob)]


def rows_of(kept: Combined) -> Iterator[list[BenchRow]]:
    """Yield the rows of each case whose parts are all there, in the order of the cases."""
    names = iter(kept.campaign.names)
    for case in msgspec.convert(kept.campaign.about, tuple[CaseFacts, ...]):
        parts = [kept.results.get(next(names)) for _ in range(case.parts)]
        there = [part.data for part in parts if part is not None]
        if len(there) == case.parts:
            values = zip(case.quantities, combined(case.quantities, there), strict=True)
            yield [row(case.name, quantity, value) for quantity, value in values]


def _parts(case: Case) -> tuple[CasePart, ...]:
    return case.parts or (CasePart(None, case.measure),)


def _item(bench: str, case: Case, part: CasePart) -> Item:
    name = name_of([KIND, bench, case.name, msgspec.to_builtins(case.quantities), part.facts])
    facts = "" if part.facts is None else f" {msgspec.json.encode(part.facts).decode()}"
    return Item(name, f"{case.name}{facts}", partial(_done, part))


def _done(part: CasePart) -> ItemResult:
    return ItemResult([float(value) for value in part.measure()])
