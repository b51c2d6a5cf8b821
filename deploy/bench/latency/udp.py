"""One-way time of raw UDP between two processes of this machine: half of a round trip, the baseline of all messages."""

from __future__ import annotations

import socket
import subprocess
import sys

from lfa.deploy.bench.harness.child_process import started
from lfa.protocol import clock

ROUNDS = 2000
EVERY_S = 0.001
"""Pause [s] between two rounds: a busy loop would keep both processes awake, which a robot's are not."""
BYTES = 200
ANSWER_S_MAX = 2.0


def one_way_ms() -> list[float]:
    """Return half of each round trip [ms] to another process, which echoes. Raises OSError if it never answers."""
    words = (sys.executable, "-c", f"from {__name__} import echo; echo()")
    with started(words, stdout=subprocess.PIPE) as child, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as own:
        assert child.stdout is not None
        own.connect(("127.0.0.1", int(child.stdout.readline())))
        own.settimeout(ANSWER_S_MAX)
        times = []
        for _ in range(ROUNDS):
            clock.sleep(EVERY_S)
            at = clock.now()
            own.send(bytes(BYTES))
            own.recv(BYTES)
            times.append(500.0 * (clock.now() - at))
        return times


def echo() -> None:
    """Send each datagram back, until the process is ended; print the port first."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as own:
        own.bind(("127.0.0.1", 0))
        print(own.getsockname()[1], flush=True)
        while True:
            data, sender = own.recvfrom(BYTES)
            own.sendto(data, sender)
