"""Version of the installed `lfa`, and the commit where it runs from a checkout."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
"""Folder that holds the packages: the checkout, or `lfa/` of an installation."""
GIT_TIMEOUT_S = 5.0


def version_line(root: Path = ROOT) -> str:
    """Return the line that `lfa --version` prints: name and version, and in a checkout the commit it stands on."""
    from importlib.metadata import version

    at = commit(root)
    return f"lfa {version('lfa')}" + (f" (commit {at})" if at else "")


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
