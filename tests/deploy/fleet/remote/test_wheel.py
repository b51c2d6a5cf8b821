"""An installation on a machine replaces nobody's editable `lfa`, and not the one that runs the command."""

from __future__ import annotations

import asyncio
import subprocess
import sys
from pathlib import Path

import pytest

from lfa.deploy.fleet.plan.fleet_file import Machine
from lfa.deploy.fleet.remote.ssh import Here
from lfa.deploy.fleet.remote.wheel import install, replaced
from lfa.protocol.errors import Refused


def _environment(folder: Path, direct_url: str = "") -> Machine:
    """Return a machine whose virtual environment has an `lfa` installed, with this record of where it came from."""
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(folder)], check=True)
    dist = next((folder / "lib").glob("python*/site-packages")) / "lfa-0.2.0.dist-info"
    dist.mkdir()
    (dist / "METADATA").write_text("Metadata-Version: 2.1\nName: lfa\nVersion: 0.2.0\n")
    if direct_url:
        (dist / "direct_url.json").write_text(direct_url)
    return Machine(address="localhost", venv=str(folder))


def test_the_lfa_that_runs_here_is_installed_anew_on_no_host_of_this_computer() -> None:
    machine = Machine(address="localhost", python=sys.executable)
    assert not asyncio.run(replaced(Here(), machine))
    asyncio.run(install(Here(), machine, "0.2.0"))


def test_an_editable_lfa_is_refused_in_one_line_and_stays(tmp_path: Path) -> None:
    machine = _environment(tmp_path / "env", '{"dir_info": {"editable": true}, "url": "file:///home/ann/lfa"}')
    with pytest.raises(
        Refused, match="has an editable lfa of file:///home/ann/lfa, which would be replaced: must be an"
    ):
        asyncio.run(install(Here(), machine, "0.2.0"))


@pytest.mark.parametrize("record", ["", '{"dir_info": {}, "url": "file:///home/ann/lfa"}', '{"archive_info": {}}'])
def test_an_lfa_that_is_installed_as_usual_is_replaced(record: str, tmp_path: Path) -> None:
    assert asyncio.run(replaced(Here(), _environment(tmp_path / "env", record)))
