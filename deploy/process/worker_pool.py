"""Worker processes of a campaign. Neither they nor their temporary files outlive the process that started them."""

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
    """Provide a pool of `jobs` processes. An exception in the block cancels the pending work and kills the workers."""
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
    """Initialise a worker: temporary files in `place`, no traceback on Ctrl-C, death with the parent."""
    tempfile.tempdir = place
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    die_with_parent(parent, signal.SIGKILL)
