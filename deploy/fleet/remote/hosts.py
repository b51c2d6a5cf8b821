"""Concurrent operations on all machines of a plan: check, start, stop, rekey; one line for each machine that fails."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Awaitable, Callable, Iterable, Mapping

import msgspec
from msgspec import Struct

from lfa.deploy.fleet.host.end import ANSWER
from lfa.deploy.fleet.host.start_check import Found
from lfa.deploy.fleet.plan.fleet_file import Engine, FleetPlan, Machine
from lfa.deploy.fleet.plan.host_plan import PART, HostPlan
from lfa.deploy.fleet.remote.ssh import Shell, Unreachable, probe, python_of, reach
from lfa.deploy.fleet.remote.wheel import install, replaced
from lfa.deploy.process.restart_policy import REFUSED_CODE
from lfa.protocol import clock
from lfa.protocol.errors import Refused
from lfa.protocol.file_reading import DamagedFile, decode_json

WIRE = f"from lfa.protocol.messages.header import WIRE_VERSION; print('{ANSWER}' + str(WIRE_VERSION))"
"""Program for a machine's Python: print the version of the messages of its `lfa`."""
STARTED = (
    "import json, os, sys; part = json.load(open(os.path.join(os.path.expanduser(sys.argv[1]), sys.argv[2]))); "
    f"print('{ANSWER}' + json.dumps({{name: part[name] for name in ('secure', 'engine', 'boot') if name in part}}))"
)
"""Program for a machine's Python, of any version of `lfa`: print how its part of the fleet was started."""
END = "lfa.deploy.fleet.host.end"
"""Program that ends a machine's part, with a quarter of the imports of `host.py`."""
CLOCK_S_MAX = 60.0
"""Maximum difference [s] of wall clocks; beyond it certificates start or end at the wrong time."""


class StartedAs(Struct, frozen=True):
    """What a fleet was started with, by its file or by options of `lfa up`."""

    secure: bool = False
    engine: Engine = "own"
    boot: bool = False

    def text(self) -> str:
        """Return the settings as a fleet file has them."""
        return f"secure = {str(self.secure).lower()}, engine = {self.engine}, boot = {str(self.boot).lower()}"


class FleetHosts:
    """Shells on the reachable machines of a plan; `wrong` has a line for each unreachable or failing machine."""

    def __init__(self, plan: FleetPlan, parts: Mapping[str, HostPlan]) -> None:
        self._plan = plan
        self.parts = dict(parts)
        self._shells: dict[str, Shell] = {}
        self.wrong: dict[str, str] = {}
        self.unreached: set[str] = set()

    async def reach(self) -> None:
        async def one(name: str) -> None:
            self._shells[name] = await reach(self._plan.hosts[name])

        await self._each(self._plan.hosts, one)

    async def check(self, *, may_install: bool) -> dict[str, Found]:
        """Check Python, version of `lfa`, clock, port and folder of each machine; install `lfa` first if allowed."""
        answers: dict[str, Found] = {}

        async def one(name: str) -> None:
            shell, machine, part = self._shells[name], self._plan.hosts[name], self.parts[name]
            if may_install:
                await install(shell, machine, part.version)
            found = await ask(shell, machine, "check", part)
            off_s = (found.wall_ms - clock.wall_ms()) / 1000.0
            if abs(off_s) > CLOCK_S_MAX:
                right = f"must be within {CLOCK_S_MAX:g} s (timedatectl set-ntp true)"
                raise Refused(f"its wall clock is {abs(off_s):.0f} s {'ahead' if off_s > 0 else 'behind'}: {right}")
            answers[name] = found

        await self._each(self._shells, one)
        return answers

    async def do(self, action: str, names: Iterable[str] | None = None) -> dict[str, Found]:
        """Run `start`, `stop` or `rekey` on each reached machine, or on `names`; return their answers."""
        answers: dict[str, Found] = {}

        async def one(name: str) -> None:
            answers[name] = await ask(self._shells[name], self._plan.hosts[name], action, self.parts[name])

        chosen = set(self._shells if names is None else names)
        await self._each({name: shell for name, shell in self._shells.items() if name in chosen}, one)
        return answers

    async def wires(self) -> dict[str, int]:
        """Return the version of the messages that the `lfa` of each reached machine speaks."""
        answers: dict[str, int] = {}

        async def one(name: str) -> None:
            python = python_of(self._plan.hosts[name])
            done = await self._shells[name].run((python, "-P", "-c", WIRE))
            if done.answer is None:
                raise Refused(f"python = {python}: has no lfa that says its version ({done.last_line})")
            answers[name] = int(done.answer)

        await self._each(self._shells, one)
        return answers

    async def started_as(self) -> dict[str, StartedAs]:
        """Return how the part of each reached machine, which runs, was started."""
        answers: dict[str, StartedAs] = {}

        async def one(name: str) -> None:
            python, state = python_of(self._plan.hosts[name]), self.parts[name].state
            done = await self._shells[name].run((python, "-P", "-c", STARTED, state, PART))
            if done.answer is None:
                raise Refused(f"{state}/{PART}: does not say how the fleet was started ({done.last_line})")
            answers[name] = decode_json(done.answer, StartedAs)

        await self._each(self._shells, one)
        return answers

    async def check_installs(self) -> None:
        """Check that an installation of `lfa` on each reached machine replaces nobody's editable one."""

        async def one(name: str) -> None:
            await replaced(self._shells[name], self._plan.hosts[name])

        await self._each(self._shells, one)

    async def renew(self, name: str) -> None:
        """Install this `lfa` on one machine, unless it uses the same, and start its part again with it."""

        async def one(name: str) -> None:
            shell, machine, part = self._shells[name], self._plan.hosts[name], self.parts[name]
            await install(shell, machine, part.version)
            await ask(shell, machine, "stop", part)
            await ask(shell, machine, "start", part)

        await self._each({name: self._shells[name]}, one)

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
            except Refused as error:
                self.wrong[name] = str(error)

        await asyncio.gather(*(guarded(name) for name in names if name not in self.wrong))


async def ask(shell: Shell, machine: Machine, action: str, part: HostPlan) -> Found:
    """Run `host.py`, or `end.py`, on a machine and return its answer. Raises Refused for a wrong Python or `lfa`."""
    python, given = python_of(machine), msgspec.json.encode(part)
    done = await shell.run((python, "-P", "-m", END), given) if action == "stop" else None
    if done is None or done.code not in (0, REFUSED_CODE):  # also for an earlier lfa, which has no END
        done = await shell.run((python, "-P", "-m", "lfa.deploy.fleet.host.host", action), given)
    if done.code == 0:
        with contextlib.suppress(DamagedFile):  # not our program: the probe finds the cause
            return decode_json(done.answer or b"", Found)
    if done.code != REFUSED_CODE or not done.err.strip():
        found = await probe(shell, python)
        if found.lfa != part.version:
            has = f"has lfa {found.lfa}" if found.lfa else "has no lfa"
            raise Refused(f"python = {python}: {has}: must be {part.version}, as here (lfa up --install)")
    raise Refused(done.last_line)
