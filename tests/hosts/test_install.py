"""`lfa up --install`: a machine without `lfa` gets this one, packed here, and nothing is fetched."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.rigs.machines import machines, why_not

WHY_NOT = why_not()
pytestmark = [
    pytest.mark.hosts,
    pytest.mark.long,
    pytest.mark.skipif(WHY_NOT is not None, reason=str(WHY_NOT)),
]


def test_a_machine_without_lfa_gets_it_and_drives_with_it() -> None:
    """Its virtual environment sees what `lfa` needs, but not `lfa`."""
    with machines(1) as fleet:
        venv = fleet.folder / "venv"
        subprocess.run([sys.executable, "-m", "venv", str(venv)], check=True)
        site = next((venv / "lib").glob("python*/site-packages"))
        (site / "needed.pth").write_text("".join(f"{path}\n" for path in sys.path if path.endswith("-packages")))
        python = venv / "bin/python"
        file = fleet.write('scenario = "straight"\nteam = 2\n', {"a": {"python": str(python)}})
        without = fleet.lfa("up", str(file))
        assert without.returncode == 2
        assert "host a: " in without.stderr
        done = fleet.lfa("up", "--install", "--json", str(file))
        assert done.returncode == 0, done.stderr
        assert set(json.loads(done.stdout)["chain"]) == {1, 2}
        assert {one.arguments[0] for one in fleet.processes("a")} == {str(python)}
        ask = [str(python), "-P", "-c", "import lfa.agents; print(lfa.agents.__file__)"]
        where = subprocess.run(ask, capture_output=True, text=True, check=True).stdout.strip()
        assert Path(where).is_relative_to(site)
        assert fleet.lfa("down", str(file)).returncode == 0
