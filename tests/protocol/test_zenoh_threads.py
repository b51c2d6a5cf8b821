"""A router's receiver threads are its own: no client that started it hands it fewer."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

SCRIPT = """
import os, sys
from protocol.bus import Inbox
from protocol.zenoh_bus import ZenohBus, answers
while not answers(sys.argv[1]):
    pass
ZenohBus(sys.argv[1], Inbox()).close()
print(os.environ.get("ZENOH_RUNTIME"))
"""


def test_what_a_client_asks_of_zenoh_is_not_inherited_by_its_children() -> None:
    with tempfile.TemporaryDirectory(prefix="lfa-", dir="/tmp") as folder:
        endpoint = f"unixsock-stream/{Path(folder) / 'router.sock'}"
        router = subprocess.Popen(
            [sys.executable, "-m", "deploy.fleet.router", "--listen", endpoint], stdout=subprocess.DEVNULL
        )
        try:
            client = [sys.executable, "-c", SCRIPT, endpoint]
            fresh = {name: value for name, value in os.environ.items() if name != "ZENOH_RUNTIME"}
            told = subprocess.run(client, capture_output=True, text=True, timeout=60, check=True, env=fresh)
        finally:
            router.kill()
            router.wait()
    assert told.stdout.strip() == "None"
