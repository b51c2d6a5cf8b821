"""Worker processes of a campaign: none outlives the process that started it, however that ends, nor do their files."""

from __future__ import annotations

import os
import signal
import tempfile
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import active_children, get_context

from lfa.deploy.process.parent_death import die_with_parent


@contextmanager
def workers(jobs: int) -> Iterator[ProcessPoolExecutor]:
    """A pool of `jobs`; what it still has to do when the block is left by an exception is not done."""
    with tempfile.TemporaryDirectory(prefix="lfa-", ignore_cleanup_errors=True) as place:
        # Spawned, not forked: the caller may have threads.
        pool = ProcessPoolExecutor(jobs, get_context("spawn"), _begin, (os.getpid(), place))
        try:
            yield pool
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            for worker in active_children():
                worker.kill()
                worker.join()
            raise
        pool.shutdown()


def _begin(parent: int, place: str) -> None:
    """In a worker: its temporary files go to `place`, and Ctrl-C, which reaches it too, leaves no traceback."""
    tempfile.tempdir = place
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    die_with_parent(parent, signal.SIGKILL)
