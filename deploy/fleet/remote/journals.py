"""Collection of a fleet's journals in one folder, from this machine's processes or over ssh from all machines."""

from __future__ import annotations

import asyncio
import io
import shutil
import tarfile
from pathlib import Path

from lfa.deploy.client.discovery import option
from lfa.deploy.fleet.host.end import ANSWER
from lfa.deploy.fleet.plan.fleet_file import FleetPlan
from lfa.deploy.fleet.plan.host_plan import HostPlan, parts
from lfa.deploy.fleet.remote.ssh import Unreachable, python_of, reach
from lfa.deploy.process.coroutines import run_to_end
from lfa.deploy.process.identity import own_processes
from lfa.deploy.recording.run_folder import JOURNALS
from lfa.deploy.whole_output import whole_folder
from lfa.protocol.errors import Refused

PACK = (
    "import pathlib, sys, tarfile\n"
    "runs = sorted(pathlib.Path(sys.argv[1]).expanduser().glob('*/journal'), key=lambda run: run.stat().st_mtime)\n"
    f"sys.stdout.write('{ANSWER}')\n"
    "sys.stdout.flush()\n"
    "with tarfile.open(fileobj=sys.stdout.buffer, mode='w|') as packed:\n"
    "    for path in (path for run in runs[-1:] for path in sorted(run.glob('*.bin'))):\n"
    "        packed.add(path, path.name)\n"
)
"""Program for the remote Python: write the journals of the newest run as a tar file to standard output, marked."""


def of_processes(fleet: str) -> set[Path]:
    """Return the journal folders of this user's processes of `fleet` on this machine."""
    found = (list(identity.arguments) for identity in own_processes())
    named = [option(words, "--journal", "") for words in found if option(words, "--fleet", "") == fleet]
    return {Path(name) for name in named if name}


def copy(folders: set[Path], run: Path) -> int:
    """Copy the journals in `folders` to `run`; return their number. An open one may lack its last entries.

    Raises OSError, and leaves none then.
    """
    journals = [path for folder in sorted(folders) for path in sorted(folder.glob("*.bin"))]
    if journals:
        with whole_folder(run / JOURNALS) as fresh:
            for path in journals:
                shutil.copyfile(path, fresh / path.name)
    return len(journals)


def fetch(plan: FleetPlan, run: Path) -> tuple[int, list[str]]:
    """Fetch the newest run's journals of all machines of `plan` to `run`; return their number, and the failures."""
    return run_to_end(_fetch(plan, run))


async def _fetch(plan: FleetPlan, run: Path) -> tuple[int, list[str]]:
    shares = parts(plan, "", "")
    answers = await asyncio.gather(*(_of_machine(plan, name, shares[name], run) for name in plan.hosts))
    wrong = [f"host {name}: {said}" for name, said in zip(plan.hosts, answers, strict=True) if isinstance(said, str)]
    return sum(answer for answer in answers if isinstance(answer, int)), wrong


async def _of_machine(plan: FleetPlan, name: str, part: HostPlan, run: Path) -> int | str:
    """Fetch the journals of one machine; return their number, or the failure."""
    machine = plan.hosts[name]
    try:
        shell = await reach(machine)
        try:
            done = await shell.run((python_of(machine), "-P", "-c", PACK, part.state))
        finally:
            await shell.close()
    except (Unreachable, Refused) as error:
        return str(error)
    if done.code != 0 or done.answer is None:
        return f"gives no journals: {done.last_line}"
    try:
        return unpack(done.answer, run)
    except tarfile.TarError as error:
        return f"gives no journals that can be read: {error}"
    except OSError as error:
        return f"its journals are not kept: {error.filename}: {error.strerror}"


def unpack(packed: bytes, run: Path) -> int:
    """Unpack the regular files `*.bin` of a tar file into the folder itself, skip the rest; return their number.

    Raises OSError and TarError, and leaves none then.
    """
    count = 0
    with whole_folder(run / JOURNALS) as fresh, tarfile.open(fileobj=io.BytesIO(packed), mode="r|") as files:
        for member in files:
            content = files.extractfile(member) if member.isreg() else None
            if content is not None and Path(member.name).suffix == ".bin":
                (fresh / Path(member.name).name).write_bytes(content.read())
                count += 1
    return count
