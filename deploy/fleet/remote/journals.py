"""Collection of a fleet's journals in one folder, from this machine's processes or over ssh from all machines.

Two journals of one name, as of a robot that ran on two machines, are both kept: the second as `robot2-7-2.bin`.
"""

from __future__ import annotations

import asyncio
import io
import itertools
import os
import re
import shutil
import tarfile
import tempfile
from pathlib import Path
from typing import BinaryIO

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

PACKED_BYTES_MAX = 4 << 30
"""Maximum size [bytes] of what one machine sends; the operator's disk keeps twice that at most."""
MEMBERS_MAX = 1024
"""Maximum number of entries that one machine sends: a journal of each start of each of some fifty processes."""
PIECE_BYTES = 256 * 1024
MARK_BYTES_MAX = 64 * 1024
"""Length [bytes] of the greeting and mark before the archive."""
JOURNAL_NAME = re.compile(r"[A-Za-z0-9_.-]{1,120}\.bin")
PACK = (
    "import pathlib, sys, tarfile\n"
    "runs = sorted(pathlib.Path(sys.argv[1]).expanduser().glob('*/journal'), key=lambda run: run.stat().st_mtime)\n"
    f"sys.stdout.write('{ANSWER}')\n"
    "sys.stdout.flush()\n"
    "with tarfile.open(fileobj=sys.stdout.buffer, mode='w|', format=tarfile.GNU_FORMAT) as packed:\n"
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
                shutil.copyfile(path, _place(path, fresh, run / JOURNALS))
    return len(journals)


def _place(journal: Path, fresh: Path, kept: Path) -> Path:
    """Return where in `fresh`, whose entries will be moved to `kept`, a journal goes: to a name of its own there.

    An earlier or a later state of the same journal is in its place.
    """
    for n in itertools.count(1):
        name = journal.name if n == 1 else f"{journal.stem}-{n}.bin"
        if all(_same_start(journal, there / name) for there in (fresh, kept) if (there / name).exists()):
            return fresh / name
    raise AssertionError("count ends")


def _same_start(one: Path, other: Path) -> bool:
    """Return True if of two files one is the beginning of the other: journals only grow."""
    with one.open("rb") as a, other.open("rb") as b:
        while (x := a.read(PIECE_BYTES)) and (y := b.read(PIECE_BYTES)):
            if not x.startswith(y) and not y.startswith(x):
                return False
    return True


def fetch(plan: FleetPlan, run: Path) -> tuple[int, list[str]]:
    """Fetch the newest run's journals of all machines of `plan` to `run`; return their number, and the failures."""
    return run_to_end(_fetch(plan, run))


async def _fetch(plan: FleetPlan, run: Path) -> tuple[int, list[str]]:
    shares, one_by_one = parts(plan, "", ""), asyncio.Lock()
    answers = await asyncio.gather(*(_of_machine(plan, name, shares[name], run, one_by_one) for name in plan.hosts))
    wrong = [f"host {name}: {said}" for name, said in zip(plan.hosts, answers, strict=True) if isinstance(said, str)]
    return sum(answer for answer in answers if isinstance(answer, int)), wrong


async def _of_machine(plan: FleetPlan, name: str, part: HostPlan, run: Path, one_by_one: asyncio.Lock) -> int | str:
    """Fetch the journals of one machine; return their number, or the failure.

    They are unpacked `one_by_one`: of two machines whose folder is not there yet, one could not rename its own to it.
    """
    machine = plan.hosts[name]
    try:
        shell = await reach(machine)
        try:
            run.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=run) as packed:
                words = (python_of(machine), "-P", "-c", PACK, part.state)
                done = await shell.run(words, into=packed, bytes_max=PACKED_BYTES_MAX)
                if done.code != 0 or not _to_answer(packed):
                    return f"gives no journals: {done.last_line}"
                async with one_by_one:
                    return await asyncio.to_thread(unpack, packed, run)
        finally:
            await shell.close()
    except (Unreachable, Refused) as error:
        return str(error)
    except tarfile.TarError as error:
        return f"gives no journals that can be read: {error}"
    except OSError as error:
        return f"its journals are not kept: {error.filename or run}: {error.strerror}"


def _to_answer(output: BinaryIO) -> bool:
    """Move to what follows the mark in a program's output; return False without a mark near its begin."""
    output.seek(0)
    at = output.read(MARK_BYTES_MAX).find(ANSWER.encode())
    output.seek(max(0, at) + len(ANSWER))
    return at >= 0


def unpack(packed: bytes | BinaryIO, run: Path) -> int:
    """Unpack the regular files `*.bin` of a tar file into the folder itself, skip the rest; return their number.

    Reads headers one by one, because `tarfile` obeys extended ones: a sparse file grows to any size, and the text of a
    header fills the memory. Raises OSError and TarError, and leaves none then.
    """
    source = io.BytesIO(packed) if isinstance(packed, bytes) else packed
    count = 0
    with whole_folder(run / JOURNALS) as fresh:
        for _ in range(MEMBERS_MAX):
            header = source.read(tarfile.BLOCKSIZE)
            if header == bytes(tarfile.BLOCKSIZE):
                _give_places(fresh, run / JOURNALS)
                return count
            member = tarfile.TarInfo.frombuf(header, "utf-8", "replace")
            if member.size < 0 or member.type == tarfile.GNUTYPE_SPARSE:
                raise tarfile.ReadError("an entry whose size is not that of its content")
            name = Path(member.name).name
            wanted = member.type in (tarfile.REGTYPE, tarfile.AREGTYPE) and JOURNAL_NAME.fullmatch(name) is not None
            _copy(source, member.size, fresh / name if wanted else Path(os.devnull))
            count += wanted
        raise tarfile.ReadError(f"more than {MEMBERS_MAX} entries")


def _give_places(fresh: Path, kept: Path) -> None:
    """Rename journals in `fresh` with the name of another one in `kept`; drop those that are there in a later state."""
    for path in sorted(fresh.iterdir()):
        place = _place(path, fresh, kept)
        there = kept / place.name
        if there.exists() and there.stat().st_size > path.stat().st_size:
            path.unlink()
        elif place != path:
            path.rename(place)


def _copy(source: BinaryIO, size: int, to: Path) -> None:
    """Write the content of an entry of `size` [bytes], and pass its padding. Raises ReadError where it is cut off."""
    with to.open("wb") as file:
        left = size
        while left:
            piece = source.read(min(left, PIECE_BYTES))
            if not piece:
                raise tarfile.ReadError("unexpected end of data")
            file.write(piece)
            left -= len(piece)
    source.read(-size % tarfile.BLOCKSIZE)
