"""Environments of programs that nobody here wrote (`make peers`), and how a test runs one."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

from tests.test_imports import ROOT

PEERS = ROOT / "tests" / "deploy" / "ros" / "peers"
PATIENCE_S = 120.0


def interpreter(name: str) -> Path:
    """Return the Python of the environment `name`; skip the test if it is not installed."""
    python = ROOT / ".peers" / name / "bin" / "python"
    if not (python.parent.parent / ".installed").is_file():
        pytest.skip(f"{name} is not installed here: make peers")
    return python


def modules(name: str) -> Path:
    """Return the folder of npm modules of the environment `name`; skip the test if the environment is not installed."""
    if not (ROOT / ".peers" / name / ".installed").is_file():
        pytest.skip(f"{name} is not installed here: make peers")
    return ROOT / ".peers" / name / "node_modules"


def start(name: str, script: str, *arguments: str, home: Path) -> subprocess.Popen[str]:
    """Start a script of `tests/deploy/ros/peers` in the environment `name`; `home` receives what it caches."""
    program = str(interpreter(name)) if script.endswith(".py") else "node"
    words = [program, str(PEERS / script), *arguments]
    environment = {**os.environ, "HOME": str(home), "NODE_PATH": str(modules(name))}
    return subprocess.Popen(
        words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment
    )


def answer(process: subprocess.Popen[str], said: str = "") -> str:
    """Return what the program printed until its end. Fails with its error text otherwise."""
    try:
        out, err = process.communicate(said, timeout=PATIENCE_S)
    except subprocess.TimeoutExpired:
        process.kill()
        out, err = process.communicate()
    assert process.returncode == 0, out + err
    return out
