"""Start of rerun's viewer process, and checks of its prerequisites."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from urllib.parse import quote

from lfa.deploy.process import parent_death
from lfa.deploy.terminal_text import print_visible
from lfa.protocol import clock
from lfa.protocol.errors import Refused

LOCAL = ("--bind", "127.0.0.1")
"""Viewers and their data are for this machine only."""
START_S_MAX, END_S_MAX = 15.0, 3.0


def run_viewer(*arguments: str) -> int:
    """Run the viewer as a child process until it is closed; Ctrl-C and SIGTERM end child and parent."""
    return await_end(subprocess.Popen([viewer_path(), *arguments], env=quiet()))


def await_end(child: subprocess.Popen[bytes]) -> int:
    """Wait until a viewer is closed and return its exit code; Ctrl-C and SIGTERM end child and parent."""
    try:
        return child.wait()
    finally:
        if child.poll() is None:
            end(child)


def serve(web_port: int, port: int, *files: str) -> subprocess.Popen[bytes]:
    """Start a viewer for browsers of this machine, and print its address; it shows `files`, or what comes at `port`."""
    ports = ("--port", str(port), "--web-viewer-port", str(web_port))
    tied = [sys.executable, parent_death.__file__, str(os.getpid()), str(int(signal.SIGTERM))]
    child = subprocess.Popen([*tied, viewer_path(), *files, "--serve-web", *LOCAL, *ports], env=quiet())
    until = clock.now() + START_S_MAX
    while child.poll() is None and clock.now() < until and not _answers(web_port):
        clock.sleep(0.05)
    print_visible(f"http://127.0.0.1:{web_port}?url={quote(data_address(port), safe='')}", flush=True)
    print_visible("open this address in a browser of this machine; Ctrl-C ends it", file=sys.stderr, flush=True)
    return child


def _answers(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


def data_address(port: int) -> str:
    """Return the address at which a viewer on this machine takes data."""
    return f"rerun+http://127.0.0.1:{port}/proxy"


def end(child: subprocess.Popen[bytes]) -> None:
    """End a viewer, and wait until it is gone."""
    child.terminate()
    try:
        child.wait(END_S_MAX)
    except subprocess.TimeoutExpired:
        child.kill()
        child.wait()


def viewer_path() -> str:
    """Return the path of the rerun binary installed with the SDK: its script would leave the binary behind."""
    spec = find_spec("rerun_cli")
    binary = Path(spec.origin).with_name("rerun") if spec is not None and spec.origin is not None else None
    return str(binary if binary is not None and binary.is_file() else Path(sys.executable).with_name("rerun"))


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
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # a viewer that has just ended takes no port
        try:
            probe.bind(("127.0.0.1", port))
        except (OSError, OverflowError):
            raise Refused(f"{option} {port}: taken, or no port of yours: give another") from None
