"""Chromium without a window, driven by its own debugging protocol: for the tests and the bench of the page."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import tempfile
import time
from base64 import b64decode
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Self

from websockets.sync.client import ClientConnection, connect

from lfa.protocol.errors import Refused

PROGRAMS = ("chromium", "chromium-browser", "google-chrome")
FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--hide-scrollbars",
    "--disable-background-networking", "--disable-component-update", "--disable-sync", "--remote-debugging-port=0",
)  # fmt: skip
START_S_MAX, WAIT_S_MAX = 30.0, 30.0
POLL_S = 0.03
REPLY_BYTES_MAX = 64 * 1024 * 1024


def chromium() -> str | None:
    """Return the path of an installed Chromium, None if there is none."""
    return next((path for path in map(shutil.which, PROGRAMS) if path), None)


class Browser:
    """One page of one Chromium with a fresh profile. `errors` are the console's errors and uncaught exceptions."""

    def __init__(self, width: int = 1366, height: int = 768) -> None:
        """Start the browser. Raises Refused without one."""
        program = chromium()
        if program is None:
            raise Refused("no Chromium here: install it with: apt-get install chromium")
        self._profile = tempfile.TemporaryDirectory(prefix="lfa-browser-", ignore_cleanup_errors=True)
        command = [program, *FLAGS, f"--user-data-dir={self._profile.name}", f"--window-size={width},{height}"]
        self._process = subprocess.Popen(
            [*command, "about:blank"], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
        )
        self._number = 0
        self.errors: list[str] = []
        self._open = ExitStack()
        self._socket = self._connect()
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")
        self.size(width, height)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the browser and remove its profile."""
        self._open.close()
        self._process.terminate()
        try:
            self._process.wait(5.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        assert self._process.stderr is not None
        self._process.stderr.close()
        self._profile.cleanup()

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Call a method of the debugging protocol and return its result."""
        self._number += 1
        self._socket.send(json.dumps({"id": self._number, "method": method, "params": parameters}))
        while True:
            message = json.loads(self._socket.recv(WAIT_S_MAX))
            if message.get("id") == self._number:
                if "error" in message:
                    raise AssertionError(f"{method}: {message['error']}")
                result: dict[str, Any] = message["result"]
                return result
            self._note(message)

    def size(self, width: int, height: int, *, touch: bool = False) -> None:
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=touch)

    def open(self, address: str) -> None:
        self.call("Page.navigate", url=address)
        self.wait_for("document.readyState === 'complete'")

    def value(self, expression: str) -> Any:
        """Return the value of a JavaScript expression; a promise is awaited."""
        result = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in result:
            raise AssertionError(f"{expression}: {result['exceptionDetails'].get('exception', {}).get('description')}")
        return result["result"].get("value")

    def wait_for(
        self, expression: str, within_s: float = WAIT_S_MAX, meanwhile: Callable[[], None] | None = None
    ) -> Any:
        """Return the value of an expression once it is true. Raises AssertionError if it does not become so."""
        until = time.perf_counter() + within_s
        while True:
            tried = f"try {{ const v = ({expression}); return v instanceof Node ? true : v }} catch {{ return null }}"
            value = self.value(f"(() => {{ {tried} }})()")
            if value:
                return value
            if time.perf_counter() > until:
                raise AssertionError(f"not within {within_s:g} s: {expression}; console: {self.errors}")
            if meanwhile is not None:
                meanwhile()
            time.sleep(POLL_S)

    def click(self, selector: str) -> None:
        """Click the middle of the element that a CSS selector names, as a finger would: what lies above it is hit."""
        x, y = self.wait_for(
            f"(() => {{ const e = document.querySelector({selector!r}); e.scrollIntoView({{block: 'nearest'}});"
            " const b = e.getBoundingClientRect();"
            " return b.width ? [b.x + b.width / 2, b.y + b.height / 2] : null })()"
        )
        self.click_at(x, y)

    def click_at(self, x: float, y: float) -> None:
        self.drag([(x, y)])

    def drag(self, path: list[tuple[float, float]]) -> None:
        """Press the mouse at the first point, move it along `path`, and let go at the last."""
        for kind, (x, y) in [
            ("mousePressed", path[0]),
            *(("mouseMoved", p) for p in path[1:]),
            ("mouseReleased", path[-1]),
        ]:
            self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", buttons=1, clickCount=1)

    def press(self, key: str, text: str = "") -> None:
        """Press and release a key by its name, such as `k` or `Escape`."""
        words = {"text": text or key} if len(key) == 1 else {}
        self.call("Input.dispatchKeyEvent", type="keyDown", key=key, **words)
        self.call("Input.dispatchKeyEvent", type="keyUp", key=key)

    def picture(self, path: Path) -> None:
        """Write what is seen as a PNG."""
        path.write_bytes(b64decode(self.call("Page.captureScreenshot", format="png")["data"]))

    def _note(self, message: dict[str, Any]) -> None:
        parameters = message.get("params", {})
        match message.get("method"):
            case "Runtime.exceptionThrown":
                self.errors.append(str(parameters["exceptionDetails"].get("exception", {}).get("description")))
            case "Runtime.consoleAPICalled" if parameters.get("type") in ("error", "warning", "assert"):
                self.errors.append(str([argument.get("value") for argument in parameters["args"]]))
            case "Log.entryAdded" if parameters["entry"].get("level") == "error":
                self.errors.append(f"{parameters['entry'].get('text')} {parameters['entry'].get('url', '')}")

    def _connect(self) -> ClientConnection:
        """Wait for the address of the debugging port on stderr, and attach to a new page."""
        assert self._process.stderr is not None
        until = time.perf_counter() + START_S_MAX
        while time.perf_counter() < until:
            found = re.search(r"ws://127\.0\.0\.1:(\d+)/", self._process.stderr.readline())
            if found:
                break
        else:
            raise AssertionError("the browser does not start")
        with connect(f"ws://127.0.0.1:{found[1]}{self._browser_path(found)}", max_size=REPLY_BYTES_MAX) as whole:
            whole.send(json.dumps({"id": 1, "method": "Target.createTarget", "params": {"url": "about:blank"}}))
            while "result" not in (reply := json.loads(whole.recv(START_S_MAX))):
                pass
        target = reply["result"]["targetId"]
        page = f"ws://127.0.0.1:{found[1]}/devtools/page/{target}"
        return self._open.enter_context(connect(page, max_size=REPLY_BYTES_MAX))

    def _browser_path(self, found: re.Match[str]) -> str:
        return found.string[found.end() - 1 :].strip()
