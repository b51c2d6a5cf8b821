"""Wheel of the `lfa` installed here, and its installation on a machine; only missing dependencies are downloaded."""

from __future__ import annotations

import base64
import hashlib
import io
import sys
import zipfile
from importlib.metadata import distribution
from pathlib import Path

from msgspec import Struct

import lfa.deploy
from lfa.deploy.fleet.host.end import ANSWER
from lfa.deploy.fleet.plan.fleet_file import Machine
from lfa.deploy.fleet.remote.ssh import Here, Shell, probe, python_of
from lfa.protocol.errors import Refused
from lfa.protocol.file_reading import DamagedFile, decode_json

PACKAGES = ("agents", "world", "protocol", "deploy")
WHEEL = "Wheel-Version: 1.0\nGenerator: lfa\nRoot-Is-Purelib: true\nTag: py3-none-any\n"
INSTALL = (
    "import os, subprocess, sys, tempfile\n"
    "name, extras, *options = sys.argv[1:]\n"
    "with tempfile.TemporaryDirectory(prefix='lfa-') as folder:\n"
    "    path = os.path.join(folder, name)\n"
    "    with open(path, 'xb') as file:\n"
    "        file.write(sys.stdin.buffer.read())\n"
    "    pip = [sys.executable, '-P', '-m', 'pip', 'install', '--quiet', '--disable-pip-version-check']\n"
    "    sys.exit(subprocess.run([*pip, *options, path + extras]).returncode)\n"
)
"""Program for the remote Python: install the wheel on its standard input, from a new folder that no other user enters.

Arguments: name of the wheel, extras such as `[world]` or none, options of pip."""
NEEDED = "import msgspec, typer, zenoh"
MAKE_VENV = ("python3", "-I", "-m", "venv")
"""Command that makes a virtual environment, with any Python 3, whatever modules lie in a home folder."""


PLACED = (
    "import json, os, site, sysconfig\n"
    "from importlib import metadata, util\n"
    "code, editable = '', ''\n"
    "try:\n"
    "    found = os.stat(util.find_spec('lfa.protocol').origin)\n"
    "    code = f'{open(\"/proc/sys/kernel/random/boot_id\").read().strip()}:{found.st_dev}:{found.st_ino}'\n"
    "except (ImportError, AttributeError, OSError, TypeError):\n"
    "    pass\n"
    "paths = [sysconfig.get_path('purelib'), sysconfig.get_path('platlib'), site.getusersitepackages()]\n"
    "for one in metadata.distributions(name='lfa', path=paths):\n"
    "    url = json.loads(one.read_text('direct_url.json') or '{}')\n"
    "    if url.get('dir_info', {}).get('editable'):\n"
    "        editable = url.get('url', '')\n"
    f"print('{ANSWER}' + json.dumps({{'code': code, 'editable': editable}}))\n"
)
"""Program for a machine's Python: print which `lfa` it has."""


class Placed(Struct, frozen=True):
    """An `lfa` that a Python has; empty: none."""

    code: str = ""
    """File of its code, and computer on which that is."""
    editable: str = ""
    """Folder of which it is an editable installation."""


async def replaced(shell: Shell, machine: Machine) -> bool:
    """Return True unless a machine's Python has the very `lfa` that runs here, as another host of this computer may.

    Raises Refused where an installation would replace an editable one: the folder that somebody works in.
    """
    python = python_of(machine)
    there, here = await _placed(shell, python), await _placed(Here(), sys.executable)
    if there.code and there.code == here.code:
        return False
    if there.editable:
        right = 'must be an environment of its own (venv = "~/lfa")'
        raise Refused(f"python = {python}: has an editable lfa of {there.editable}, which would be replaced: {right}")
    return True


async def _placed(shell: Shell, python: str) -> Placed:
    """Return which `lfa` a Python has; none where the program does not run, as with no Python at all."""
    try:
        return decode_json((await shell.run((python, "-P", "-c", PLACED))).answer or b"", Placed)
    except DamagedFile:
        return Placed()


def pack() -> tuple[str, bytes]:
    """Return name and content of a wheel of the packages as installed here."""
    dist = distribution("lfa")
    name = f"lfa-{dist.version}"
    root = Path(lfa.deploy.__file__).parent.parent
    files = {
        f"lfa/{path.relative_to(root)}": path.read_bytes()
        for package in PACKAGES
        for path in sorted((root / package).rglob("*"))
        if path.is_file() and "__pycache__" not in path.parts
    }
    files[f"{name}.dist-info/METADATA"] = (dist.read_text("METADATA") or "").encode()
    files[f"{name}.dist-info/entry_points.txt"] = (dist.read_text("entry_points.txt") or "").encode()
    files[f"{name}.dist-info/WHEEL"] = WHEEL.encode()
    record = [f"{path},sha256={_digest(data)},{len(data)}" for path, data in files.items()]
    record_path = f"{name}.dist-info/RECORD"
    files[record_path] = ("\n".join([*record, f"{record_path},,"]) + "\n").encode()
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for path, data in files.items():
            archive.writestr(path, data)
    return f"{name}-py3-none-any.whl", packed.getvalue()


async def install(shell: Shell, machine: Machine, wanted: str) -> None:
    """Install this `lfa` on a machine, unless it has the very same; create its virtual environment if it is missing.

    Raises Refused.
    """
    python = python_of(machine)
    if machine.venv and (await shell.run((python, "-c", ""))).code != 0:
        await _must(shell, (*MAKE_VENV, machine.venv), f"venv = {machine.venv}")
    await probe(shell, python)
    if not await replaced(shell, machine):
        return
    name, data = pack()
    pip = (python, "-P", "-c", INSTALL, name)
    await _must(shell, (*pip, "", "--no-deps", "--force-reinstall"), f"installing lfa {wanted}", data)
    if (await shell.run((python, "-P", "-c", NEEDED))).code != 0:
        await _must(shell, (*pip, "[world]"), f"installing what lfa {wanted} needs", data)


async def _must(shell: Shell, words: tuple[str, ...], doing: str, stdin: bytes = b"") -> None:
    done = await shell.run(words, stdin)
    if done.code != 0:
        raise Refused(f"{doing} fails ({done.last_line})")


def _digest(data: bytes) -> str:
    return base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
