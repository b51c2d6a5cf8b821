"""Version of the installed `lfa`, and the commit where it runs from a checkout."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
"""Folder that holds the packages: the checkout, or `lfa/` of an installation."""
PACKAGES = ("protocol", "agents", "world", "deploy")
CODE_DIGITS = 12
GIT_TIMEOUT_S = 5.0


def version_line(root: Path = ROOT) -> str:
    """Return the line that `lfa --version` prints: name and version, and in a checkout the commit it stands on."""
    from importlib.metadata import version

    at = commit(root)
    return f"lfa {version('lfa')}" + (f" (commit {at})" if at else "")


def code_line(root: Path = ROOT) -> str:
    """Return name, version and a hash of the code: equal where the same runs would give the same results."""
    from importlib.metadata import version

    return f"lfa {version('lfa')} (code {code_digits(root)})"


@cache
def code_digits(root: Path = ROOT) -> str:
    """Return a hash of the code, in hexadecimal digits.

    A commit says less: an installation has none, and a checkout may have been changed.
    """
    digest = hashlib.sha256()
    for path in sorted(found for package in PACKAGES for found in (root / package).rglob("*.py")):
        digest.update(path.relative_to(root).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()[:CODE_DIGITS]


def commit(root: Path) -> str | None:
    """Return the short hash of the checkout at `root`, with `-dirty` if files differ from it.

    None for an installation, which may lie inside of somebody else's checkout, or where git cannot tell.
    """
    if not (root / ".git").exists():
        return None
    import subprocess

    words = ("git", "-C", str(root), "describe", "--always", "--dirty", "--exclude", "*")
    try:
        done = subprocess.run(words, capture_output=True, text=True, timeout=GIT_TIMEOUT_S, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return None
    return done.stdout.strip() or None if done.returncode == 0 else None
