"""A command that is a coroutine ends in order when SIGTERM comes."""

from __future__ import annotations

import asyncio
import os
import signal

import pytest

from lfa.deploy.process.coroutines import run_to_end


def test_sigterm_in_the_midst_of_another_task_cancels_the_command_and_leaves_nothing_unretrieved() -> None:
    unretrieved: list[str] = []
    undone: list[str] = []

    async def ended_by_another_task() -> None:
        asyncio.get_running_loop().set_exception_handler(lambda _loop, context: unretrieved.append(context["message"]))
        other = asyncio.create_task(_terminate())
        try:
            await asyncio.Event().wait()
        finally:
            undone.append("what was begun")
            await other

    with pytest.raises(SystemExit) as ended:
        run_to_end(ended_by_another_task())
    assert (ended.value.code, undone, unretrieved) == (143, ["what was begun"], [])


def test_the_handler_of_before_is_back_afterwards() -> None:
    before = signal.getsignal(signal.SIGTERM)

    async def seven() -> int:
        return 7

    assert run_to_end(seven()) == 7
    assert signal.getsignal(signal.SIGTERM) is before


async def _terminate() -> None:
    os.kill(os.getpid(), signal.SIGTERM)
