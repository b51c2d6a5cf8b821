"""Start of rerun's viewer process, and checks of its prerequisites."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from lfa.protocol.errors import Refused

if TYPE_CHECKING:
    pass


def run_viewer(*arguments: str) -> int:
    """Run the viewer as a child process until it is closed; Ctrl-C and SIGTERM end child and parent."""
    child = subprocess.Popen(["rerun", *arguments], executable=viewer_path(), env=quiet())
    try:
        return child.wait()
    except (KeyboardInterrupt, SystemExit):
        child.send_signal(signal.SIGTERM)
        child.wait()
        raise


def viewer_path() -> str:
    """Return the path of the rerun binary installed with the SDK."""
    return str(Path(sys.executable).with_name("rerun"))


def quiet() -> dict[str, str]:
    return {"RUST_LOG": "error", **os.environ}


def has_display() -> bool:
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def need_rerun() -> None:
    try:
        import rerun  # noqa: F401
    except ImportError:
        raise Refused("view needs rerun: install with: pip install 'lfa[view]'") from None


def check_free_port(port: int, option: str) -> None:
    with socket.socket() as probe:
        try:
            probe.bind(("127.0.0.1", port))
        except (OSError, OverflowError):
            raise Refused(f"{option} {port}: taken, or no port of yours: give another") from None
