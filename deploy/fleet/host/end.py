"""`python -m lfa.deploy.fleet.host.end`: end this machine's part of a fleet; executed on each machine by `lfa down`.

Reads a HostPlan as `host.py` does, prints the same answer, and imports little: a machine with all hosts of a test, or a
small computer on a robot, spends more time on imports than on the end of the processes.
"""

from __future__ import annotations

import lfa.protocol.program_start.installed_first  # noqa: F401 (before any other module)

# isort: split
import signal
import sys
from collections.abc import Callable
from pathlib import Path

import msgspec
from msgspec import Struct

from lfa.deploy.fleet.host.ledger import GUARDIAN, Ledger, end_orphans, living, sweep, watchers
from lfa.deploy.fleet.plan.files import PART
from lfa.deploy.process.identity import Identity, identify, send_signal
from lfa.deploy.terminal_text import print_visible
from lfa.protocol import clock
from lfa.protocol.errors import Refused
from lfa.protocol.file_reading import DamagedFile, decode_json, read_json

ANSWER = "lfa-answer:"
"""Mark before an answer: a shell may print a greeting, to the same output, before it runs a command."""
STOP_S = 8.0
POLL_S = 0.05
OTHER_ENGINE = 3
"""Exit code: the machine's processes are not its supervisor's; `host.py` ends them."""


class _Asked(Struct):
    """What `end` needs of a HostPlan."""

    state: str
    version: str


class _Written(Struct):
    """What `end` needs of the plan that was started last."""

    engine: str = "own"


class _Ended(Struct):
    """Answer, as the fields of `Found` that this program knows."""

    version: str
    wall_ms: int
    run: str = ""
    digest: str = ""


def engine_of(folder: Path) -> str:
    """Return the engine of the plan that was started last in `folder`; `own` if there is none that can be read."""
    try:
        return read_json(folder / PART, _Written).engine
    except (OSError, DamagedFile):
        return "own"


def end(folder: Path) -> Ledger | None:
    """End the watchers and processes of a machine with the engine `own`, by SIGKILL after STOP_S.

    Returns the ledger of the supervisor that was running, None if none was. Raises Refused when a process remains.
    """
    running = living(folder)
    if running is None:
        end_orphans(folder)
        sweep(folder)
        return None
    guardians = tuple(watchers(folder, GUARDIAN))
    everybody = (*guardians, running.supervisor, *running.children)
    send_signal(running.supervisor, signal.SIGTERM)  # first, or it would start a guardian again
    for guardian in guardians:
        send_signal(guardian, signal.SIGTERM)
        send_signal(guardian, signal.SIGCONT)
    wait_gone(everybody, STOP_S)
    for identity in everybody:
        send_signal(identity, signal.SIGKILL)
    refuse_left(wait_gone(everybody, 1.0))
    sweep(folder)
    return running


def wait_gone(everybody: tuple[Identity, ...], within_s: float) -> list[Identity]:
    """Wait until all processes have ended; return those that have not `within_s` [s]."""
    until = clock.now() + within_s
    while True:
        left = [identity for identity in everybody if identify(identity.pid) == identity]
        if not left or clock.now() > until:
            return left
        clock.sleep(POLL_S)


def refuse_left(left: list[Identity]) -> None:
    """Raise Refused for the first of the processes that did not end."""
    if left:
        raise Refused(f"process {left[0].pid} does not end: {' '.join(left[0].arguments)}")


def print_answer(answer: Callable[[bytes], Struct]) -> None:
    """Print what `answer` makes of standard input; or an error in one line, with exit code 2 for what is refused."""
    try:
        print_visible(f"{ANSWER}{msgspec.json.encode(answer(sys.stdin.buffer.read())).decode()}")
    except (Refused, DamagedFile) as refused:
        print_visible(refused, file=sys.stderr)
        sys.exit(2)
    except OSError as error:
        print_visible(f"{error.filename or 'lfa'}: {error.strerror}", file=sys.stderr)
        sys.exit(1)


def _answer(given: bytes) -> _Ended:
    asked = decode_json(given, _Asked)
    folder = Path(asked.state).expanduser()
    if engine_of(folder) != "own":
        sys.exit(OTHER_ENGINE)
    ended = end(folder)
    run, digest = ("", "") if ended is None else (ended.run, ended.digest)
    return _Ended(asked.version, clock.wall_ms(), run, digest)


if __name__ == "__main__":
    print_answer(_answer)
