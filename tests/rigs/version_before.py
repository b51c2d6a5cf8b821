"""The code of the last commit with the version of the messages before, and a Python that runs it."""

from __future__ import annotations

import io
import subprocess
import sys
import tarfile
from pathlib import Path

import pytest

BEFORE = "8b1b7b48a8b5364425fd9c6574852c7a0b601dfd"
"""Last commit with version 5 of the messages."""
PACKAGES = ("agents", "deploy", "protocol", "world", ".namespace")
ROOT = Path(__file__).parents[2]


def code_before(folder: Path) -> Path:
    """Write the code of that commit to `folder` and return the path to import it from; a clone without it skips."""
    packed = subprocess.run(["git", "archive", BEFORE, *PACKAGES], cwd=ROOT, capture_output=True, check=False)
    if packed.returncode != 0:
        pytest.skip(f"this clone has no commit {BEFORE[:8]}: {packed.stderr.decode().strip()}")
    with tarfile.open(fileobj=io.BytesIO(packed.stdout)) as archive:
        archive.extractall(folder, filter="tar")
    return folder / ".namespace"


def python_with(code: Path, venv: Path) -> Path:
    """Return the Python of a new environment at `venv`, which has what `lfa` needs and imports it from `code`.

    An upgrade installs there, and nowhere else.
    """
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(venv)], check=True)
    site = next((venv / "lib").glob("python*/site-packages"))
    needed = [str(code), *(path for path in sys.path if path.endswith("-packages"))]
    (site / "needed.pth").write_text("".join(f"{path}\n" for path in needed))
    return venv / "bin" / "python"
