"""A real small file system that fills up, for what must go on when a write fails."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest


@contextmanager
def small_disk(at: Path, kib: int) -> Iterator[Path]:
    """Mount a tmpfs of `kib` KiB at `at`; skip the test where that is not permitted."""
    at.mkdir(parents=True, exist_ok=True)
    mounting = ["mount", "-t", "tmpfs", "-o", f"size={kib}k", "lfa-test", str(at)]
    if os.geteuid() != 0 or subprocess.run(mounting, capture_output=True, check=False).returncode != 0:
        pytest.skip("mounting a tmpfs needs root")
    try:
        yield at
    finally:
        subprocess.run(["umount", "--lazy", str(at)], check=True)


def fill(folder: Path) -> Path:
    """Fill the file system of `folder` to the last byte with one file; return the file."""
    filler = folder / "filler"
    with filler.open("wb", buffering=0) as file:
        try:
            while True:
                file.write(bytes(4096))
        except OSError:
            pass
    for log in folder.rglob("*.log"):  # up to the end of its page, which is its own
        with log.open("ab") as file:
            file.write(b"." * (-log.stat().st_size % 4096))
    return filler


@contextmanager
def read_only(at: Path) -> Iterator[None]:
    """Make the file system mounted at `at` read-only for the time of the block."""
    subprocess.run(["mount", "-o", "remount,ro", str(at)], check=True)
    try:
        yield
    finally:
        subprocess.run(["mount", "-o", "remount,rw", str(at)], check=True)
