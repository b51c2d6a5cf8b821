"""`lfa web` in a process of its own, and a browser on its page."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from urllib.parse import urlsplit

from lfa.deploy.bench.harness.browser import Browser
from tests.rigs.lfa_runs import LFA


class Served:
    """Running `lfa web`, with its two addresses."""

    def __init__(self, *arguments: str) -> None:
        command = [*LFA, "web", *arguments, "--port", "0"]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        assert self.process.stdout is not None
        lines = [self.process.stdout.readline() for _ in range(2)]
        if not lines[1]:
            raise AssertionError(f"{command}: {self.process.communicate()[1]}")
        self.operate, self.look = (line.split()[-1] for line in lines)

    @property
    def host(self) -> str:
        """Host and port of the page."""
        return urlsplit(self.operate).netloc

    def socket(self, address: str) -> str:
        """Return the WebSocket's address for a viewer who knows `address`."""
        return f"ws://{self.host}/ws?{urlsplit(address).query}"

    def end(self) -> tuple[int, str]:
        """End the server as Ctrl-C does; return its exit code and what it wrote on stderr."""
        self.process.terminate()
        _, errors = self.process.communicate(timeout=10.0)
        return self.process.returncode, errors


@contextmanager
def served(*arguments: str) -> Iterator[Served]:
    """Run `lfa web`; at the end it must have written no error."""
    server = Served(*arguments)
    try:
        yield server
    finally:
        code, errors = server.end()
    assert (code, errors) == (143, ""), f"`lfa web` ended with {code}: {errors}"


def place(browser: Browser, robot: int) -> tuple[float, float]:
    """Return where on the page a robot is drawn [px]."""
    x, y = browser.value(
        f"(() => {{ const s = lfa.stages[0], r = lfa.models[0].robots.get({robot}), p = s.toScreen(r.x, r.y),"
        " b = s.canvas.getBoundingClientRect(); return [p[0] + b.x, p[1] + b.y] })()"
    )
    return x, y


def point(browser: Browser, x: float, y: float) -> tuple[float, float]:
    """Return where on the page a point [m] in `map` is drawn [px]."""
    px, py = browser.value(
        f"(() => {{ const s = lfa.stages[0], p = s.toScreen({x}, {y}), b = s.canvas.getBoundingClientRect();"
        " return [p[0] + b.x, p[1] + b.y] })()"
    )
    return px, py
