"""All machines of a plan at once: asked whether they would do, brought up, taken down; what is wrong is a line each."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Mapping

import msgspec

from deploy.fleet.file import Machine, Plan
from deploy.fleet.host import Found
from deploy.fleet.part import Part
from deploy.fleet.remote import Shell, Unreachable, probe, python_of, reach
from deploy.fleet.wheel import install
from protocol import clock
from protocol.mission import Refused

CLOCK_S_MAX = 60.0
"""Beyond it certificates begin or end at the wrong time."""


class Fleet:
    """A shell on each machine that can be reached; `wrong` has a line for each that cannot, or does not obey."""

    def __init__(self, plan: Plan, parts: Mapping[str, Part]) -> None:
        self._plan = plan
        self.parts = dict(parts)
        self._shells: dict[str, Shell] = {}
        self.wrong: dict[str, str] = {}
        self.unreached: set[str] = set()

    async def reach(self) -> None:
        async def one(name: str) -> None:
            self._shells[name] = await reach(self._plan.hosts[name])

        await self._each(self._plan.hosts, one)

    async def prepare(self, *, may_install: bool) -> None:
        """Python, the same `lfa`, the clock; `lfa` is installed where it is missing and that is wanted."""

        async def one(name: str) -> None:
            shell, machine = self._shells[name], self._plan.hosts[name]
            wall_ms = await _prepared(shell, machine, self.parts[name].version, may_install=may_install)
            off_s = (wall_ms - clock.wall_ms()) / 1000.0
            if abs(off_s) > CLOCK_S_MAX:
                right = f"must be within {CLOCK_S_MAX:g} s (timedatectl set-ntp true)"
                raise Refused(f"its wall clock is {abs(off_s):.0f} s {'ahead' if off_s > 0 else 'behind'}: {right}")

        await self._each(self._shells, one)

    async def do(self, deed: str) -> dict[str, Found]:
        """`check`, `start` or `stop` on each machine that is reached; what they say."""
        answers: dict[str, Found] = {}

        async def one(name: str) -> None:
            python, part = python_of(self._plan.hosts[name]), self.parts[name]
            words = (python, "-m", "deploy.fleet.host", deed)
            done = await self._shells[name].run(words, msgspec.json.encode(part))
            if done.code != 0:
                raise Refused(done.last_line)
            answers[name] = msgspec.json.decode(done.out, type=Found)

        await self._each(self._shells, one)
        return answers

    async def close(self) -> None:
        await asyncio.gather(*(shell.close() for shell in self._shells.values()), return_exceptions=True)

    def lines(self) -> list[str]:
        return [f"host {name}: {self.wrong[name]}" for name in self._plan.hosts if name in self.wrong]

    async def _each(self, names: Mapping[str, object], one: Callable[[str], Awaitable[None]]) -> None:
        async def guarded(name: str) -> None:
            try:
                await one(name)
            except Unreachable as error:
                self.unreached.add(name)
                self.wrong[name] = str(error)
            except (Refused, msgspec.DecodeError) as error:
                self.wrong[name] = str(error)

        await asyncio.gather(*(guarded(name) for name in names if name not in self.wrong))


async def _prepared(shell: Shell, machine: Machine, wanted: str, *, may_install: bool) -> int:
    """The machine's wall clock [ms], once the right `lfa` is there. Raises Refused."""
    python = python_of(machine)
    if may_install:
        await install(shell, machine, wanted)
    found = await probe(shell, python)
    if found.lfa != wanted:
        has = f"has lfa {found.lfa}" if found.lfa else "has no lfa"
        raise Refused(f"python = {python}: {has}: must be {wanted}, as here (lfa up --install)")
    return found.wall_ms
