"""Execution of items by worker processes: a worker that is killed loses the item that it was in, and no other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack
from typing import NamedTuple

from lfa.deploy.campaign.items import Item, ItemResult
from lfa.deploy.process.worker_pool import workers

TRIES_MAX = 2
"""Number of workers that may die in one item; then the item is at fault."""


class Finished(NamedTuple):
    """Item that was tried, and its result; None if it could not be done, for the `reason` given."""

    item: Item
    result: ItemResult | None
    reason: str = ""


def execute(items: Sequence[Item], jobs: int) -> Iterator[Finished]:
    """Do the items in `jobs` processes and yield each as it ends; with one job in a process of its own too."""
    with ExitStack() as stack:
        waiting, tries = list(reversed(items)), dict[str, int]()
        idle = [stack.enter_context(workers(1)) for _ in range(min(jobs, len(items)))]
        busy: dict[Future[ItemResult], tuple[Item, ProcessPoolExecutor]] = {}
        while waiting or busy:
            while waiting and idle:
                item, pool = waiting.pop(), idle.pop()
                busy[pool.submit(item.measure)] = item, pool
            for future in wait(busy, return_when=FIRST_COMPLETED).done:
                item, pool = busy.pop(future)
                died = isinstance(future.exception(), BrokenProcessPool)
                idle.append(stack.enter_context(workers(1)) if died else pool)
                tries[item.name] = tries.get(item.name, 0) + 1
                if died and tries[item.name] < TRIES_MAX:
                    waiting.append(item)
                else:
                    yield _finished(item, future)


def _finished(item: Item, future: Future[ItemResult]) -> Finished:
    error = future.exception()
    if error is None:
        return Finished(item, future.result())
    if isinstance(error, KeyboardInterrupt):  # a signal ended the item, so the campaign ends too
        raise error
    reason = "its worker died" if isinstance(error, BrokenProcessPool) else f"{type(error).__name__}: {error}"
    return Finished(item, None, " ".join(reason.split()))
