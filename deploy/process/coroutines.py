"""A coroutine as the whole of a command, ended by SIGTERM in order."""

from __future__ import annotations

import asyncio
import signal
import sys
from collections.abc import Coroutine
from typing import Any, TypeVar

T = TypeVar("T")


def run_to_end(command: Coroutine[Any, Any, T]) -> T:
    """Run a coroutine to its end and return its result; SIGTERM cancels it. Raises SystemExit (143) then.

    A signal handler that raises would end whichever task happens to run, as a traceback of that task.
    """
    told = False

    async def guarded() -> T:
        loop, task = asyncio.get_running_loop(), asyncio.current_task()
        assert task is not None

        def end() -> None:
            nonlocal told
            told = True
            task.cancel()

        loop.add_signal_handler(signal.SIGTERM, end)
        return await command

    before = signal.getsignal(signal.SIGTERM)
    try:
        return asyncio.run(guarded())
    except asyncio.CancelledError:
        if not told:
            raise
        sys.exit(128 + signal.SIGTERM)
    finally:
        signal.signal(signal.SIGTERM, before)
