"""Command execution on a machine: over ssh with the user's configuration, keys and known hosts, or on this machine."""

from __future__ import annotations

import asyncio
import shlex
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO, Protocol

from msgspec import Struct

from lfa.deploy.fleet.host.end import ANSWER
from lfa.deploy.fleet.plan.fleet_file import Machine
from lfa.protocol.errors import Refused
from lfa.protocol.file_reading import DamagedFile, decode_json

CONNECT_S = 6.0
COMMAND_S = 40.0
PYTHON_MIN = (3, 11)
GREETING_MAX = 80
OUTPUT_BYTES_MAX = 16 * 1024 * 1024
"""Maximum length [bytes] of what a command may print to one of its outputs."""
PIECE_BYTES = 256 * 1024
PROBE = (
    "import sys\n"
    "sys.path[:] = [folder for folder in sys.path if folder]\n"  # -P, which Python has from 3.11 on
    "import json, time\n"
    "try:\n"
    "    from importlib.metadata import version\n"
    "    lfa = version('lfa')\n"
    "except Exception:\n"
    "    lfa = ''\n"
    "answer = {'python': list(sys.version_info[:3]), 'lfa': lfa, 'wall_ms': int(time.time() * 1000)}\n"
    f"print('{ANSWER}' + json.dumps(answer))\n"
)
"""Program for any remote Python, with or without `lfa`: print the versions and the wall clock as JSON."""


class Done(Struct, frozen=True):
    """Result of a command: exit code, standard output and standard error."""

    code: int
    out: bytes
    err: bytes

    @property
    def last_line(self) -> str:
        lines = self.err.decode(errors="replace").strip().splitlines()
        return lines[-1].strip() if lines else f"exit code {self.code}"

    @property
    def answer(self) -> bytes | None:
        """What the program printed after its mark, whatever its shell printed before; None without the mark."""
        _, mark, answer = self.out.partition(ANSWER.encode())
        return answer if mark else None

    @property
    def greeting(self) -> str:
        """First line of an output without an answer, for an error text; empty: no output."""
        lines = self.out.decode(errors="replace").strip().splitlines()
        return lines[0].strip()[:GREETING_MAX] if lines else ""


class Probed(Struct, frozen=True):
    """Python version of a machine, its version of `lfa` (empty: none), and its wall clock [ms]."""

    python: tuple[int, int, int]
    lfa: str
    wall_ms: int


class Shell(Protocol):
    """Interface for running commands on a machine."""

    async def run(
        self, words: Sequence[str], stdin: bytes = b"", into: BinaryIO | None = None, bytes_max: int = OUTPUT_BYTES_MAX
    ) -> Done:
        """Run a command to its end; write its standard output to the file `into`, if given, in place of `Done.out`.

        Raises Unreachable when the machine is lost meanwhile or prints more than `bytes_max`, and Refused when `into`
        cannot be written.
        """

    async def close(self) -> None: ...


class Unreachable(Exception):
    """Failure to run commands on a machine; the text gives the cause, and what is required."""


class Here:
    """Shell on this machine."""

    async def run(
        self, words: Sequence[str], stdin: bytes = b"", into: BinaryIO | None = None, bytes_max: int = OUTPUT_BYTES_MAX
    ) -> Done:
        pipe = asyncio.subprocess.PIPE
        try:
            child = await asyncio.create_subprocess_exec(*words, stdin=pipe, stdout=pipe, stderr=pipe)
        except OSError as error:
            return Done(127, b"", f"{words[0]}: {error.strerror}".encode())
        try:
            out, err = await _talk(child, stdin, into, bytes_max)
        except BaseException:
            with suppress(ProcessLookupError):
                child.kill()
            for output in (child.stdout, child.stderr):  # `wait` waits for the end of both
                while output is not None and await output.read(PIECE_BYTES):
                    pass
            raise
        finally:
            await child.wait()
        return Done(child.returncode or 0, out, err)

    async def close(self) -> None:
        """Do nothing: no connection was opened."""


class Ssh:
    """Shell on a machine over ssh; `~` in the first word is the home folder on that machine."""

    def __init__(self, connection: Any) -> None:
        self._connection = connection

    async def run(
        self, words: Sequence[str], stdin: bytes = b"", into: BinaryIO | None = None, bytes_max: int = OUTPUT_BYTES_MAX
    ) -> Done:
        import asyncssh

        first = f"~/{shlex.quote(words[0][2:])}" if words[0].startswith("~/") else shlex.quote(words[0])
        command = " ".join([first, *map(shlex.quote, words[1:])])
        try:
            async with asyncio.timeout(COMMAND_S), self._connection.create_process(command, encoding=None) as child:
                out, err = await _talk(child, stdin, into, bytes_max)
                await child.wait_closed()
        except TimeoutError:  # also raised by asyncssh
            raise Unreachable(f"no answer within {COMMAND_S:g} s to: {words[0]}") from None
        except (OSError, asyncssh.Error) as error:
            raise Unreachable(f"lost its connection ({error})") from None
        return Done(-1 if child.returncode is None else child.returncode, out, err)

    async def close(self) -> None:
        self._connection.close()
        await self._connection.wait_closed()


async def _talk(child: Any, stdin: bytes, into: BinaryIO | None, bytes_max: int) -> tuple[bytes, bytes]:
    """Give a process its input and return what it prints, in bounds. Raises as `Shell.run` does."""

    async def give() -> None:
        with suppress(OSError):  # it ends without reading
            child.stdin.write(stdin)
            await child.stdin.drain()
            child.stdin.write_eof()

    giving = asyncio.ensure_future(give())
    out = asyncio.ensure_future(_read(child.stdout, into, bytes_max))
    err = asyncio.ensure_future(_read(child.stderr, None, OUTPUT_BYTES_MAX))
    try:
        await asyncio.gather(giving, out, err)
    finally:
        for task in (giving, out, err):
            task.cancel()
        await asyncio.wait((giving, out, err))  # nobody else may read an output while one of them still waits for it
    return out.result(), err.result()


async def _read(output: Any, into: BinaryIO | None, bytes_max: int) -> bytes:
    """Return all that a process prints, or write it to `into` and return nothing."""
    got, length = bytearray(), 0
    while piece := await output.read(PIECE_BYTES):
        length += len(piece)
        if length > bytes_max:
            raise Unreachable(f"prints more than {bytes_max >> 20} MiB")
        if into is None:
            got += piece
            continue
        try:
            into.write(piece)
        except OSError as error:
            raise Refused(f"what it prints is not kept: {error.strerror}") from None
    return bytes(got)


async def reach(machine: Machine) -> Shell:
    """Open a shell on `machine`. Raises Unreachable, and Refused without asyncssh."""
    if machine.local:
        return Here()
    try:
        import asyncssh
    except ImportError:
        raise Refused("ssh needs what is not installed here: pip install 'lfa[deploy]'") from None
    name = machine.ssh or machine.address
    said: dict[str, Any] = {"config": [str(path) for path in (Path.home() / ".ssh/config",) if path.exists()]}
    if machine.user:
        said["username"] = machine.user
    if machine.port:
        said["port"] = machine.port
    try:
        connecting = asyncssh.connect(name, connect_timeout=CONNECT_S, login_timeout=CONNECT_S, **said)
        return Ssh(await asyncio.wait_for(connecting, CONNECT_S + 1.0))
    except asyncssh.HostKeyNotVerifiable:
        raise Unreachable(f"ssh knows no key of {name}, or another: connect by hand once (ssh {name})") from None
    except asyncssh.PermissionDenied:
        who = f"{machine.user}@{name}" if machine.user else name
        raise Unreachable(f"refuses your key: must let you in by key (ssh-copy-id {who})") from None
    except TimeoutError:
        raise Unreachable(f"cannot be reached by ssh at {name}: no answer within {CONNECT_S:g} s") from None
    except (OSError, asyncssh.Error, UnicodeError) as error:
        raise Unreachable(f"cannot be reached by ssh at {name} ({_reason(error)})") from None


def python_of(machine: Machine) -> str:
    if machine.venv:
        return f"{machine.venv.rstrip('/')}/bin/python"
    return machine.python or (sys.executable if machine.local else "python3")


async def probe(shell: Shell, python: str) -> Probed:
    """Return the versions and clock of a machine. Raises Refused when Python is missing or older than PYTHON_MIN."""
    done = await shell.run((python, "-c", PROBE))
    try:
        found = decode_json(done.answer or b"", Probed)
    except DamagedFile:
        if done.code == 0 and done.greeting:
            right = "make its shell silent for commands, and let it run them"
            raise Refused(f"prints {done.greeting!r} and no answer: {right}") from None
        raise Refused(f"python = {python}: does not run there ({done.last_line}): must be Python 3.11+") from None
    if found.python < (*PYTHON_MIN, 0):
        is_ = ".".join(map(str, found.python))
        raise Refused(f"python = {python}: is {is_} there: must be {'.'.join(map(str, PYTHON_MIN))} or newer")
    return found


def _reason(error: Exception) -> str:
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    return " ".join(str(error).split()) or type(error).__name__
