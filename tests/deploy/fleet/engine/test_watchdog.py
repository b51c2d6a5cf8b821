"""Watchdog: who hung is told once, signs of life count for their sender only, and nobody waits for a full queue."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from lfa.deploy.fleet.engine.watchdog import SIGNS_MAX, STANDSTILL_S, START_S, HangDetector, SignSocket
from lfa.protocol.errors import Refused
from lfa.protocol.runtime.systemd import Notify


def watched(limit_s: float = 2.0) -> HangDetector:
    watchdog = HangDetector(limit_s)
    watchdog.started("robot1", 0.0)
    watchdog.alive("robot1", 0.0)
    return watchdog


def hung(watchdog: HangDetector, from_s: float, until_s: float) -> list[str]:
    """Look every tenth of a second."""
    found: list[str] = []
    for n in range(round(10 * from_s), round(10 * until_s) + 1):
        found += watchdog.hung(n / 10)
    return found


def test_who_shows_no_sign_within_the_limit_hung_and_is_told_once() -> None:
    assert hung(watched(), 0.0, 1.9) == []
    assert hung(watched(), 0.0, 9.0) == ["robot1"]


def test_a_sign_gives_the_whole_time_again() -> None:
    watchdog = watched()
    hung(watchdog, 0.0, 1.5)
    watchdog.alive("robot1", 1.5)
    assert hung(watchdog, 1.6, 3.4) == []


def test_a_start_may_take_longer_than_the_limit() -> None:
    watchdog = HangDetector(2.0)
    watchdog.started("robot1", 0.0)
    assert hung(watchdog, 0.0, START_S) == []


def test_a_watcher_that_stood_still_accuses_nobody() -> None:
    watchdog = watched()
    assert watchdog.hung(0.5) == []
    after_s = 60.0 + STANDSTILL_S
    assert watchdog.hung(after_s) == []
    assert hung(watchdog, after_s, after_s + 1.9) == []
    assert hung(watchdog, after_s + 2.0, after_s + 2.2) == ["robot1"]


def test_what_ended_does_not_hang() -> None:
    watchdog = watched()
    watchdog.ended("robot1")
    assert hung(watchdog, 0.0, 9.0) == []


@pytest.fixture
def signs(tmp_path: Path) -> SignSocket:
    return SignSocket(tmp_path / "s")


def test_a_sign_counts_for_the_process_that_sent_it(signs: SignSocket, tmp_path: Path) -> None:
    Notify(str(tmp_path / "s")).alive()
    code = "import sys; from lfa.protocol.runtime.systemd import Notify; Notify(sys.argv[1]).ready()"
    child = subprocess.Popen([sys.executable, "-c", code, str(tmp_path / "s")])
    child.wait()
    assert signs.take() == {os.getpid(), child.pid}
    assert signs.take() == set()


@pytest.mark.parametrize("sign", [b"", b"STOPPING=1", b"WATCHDOG=0", b"\xff" * 5000, b"MAINPID=1\nSTATUS=WATCHDOG=1"])
def test_other_words_are_no_sign_of_life(signs: SignSocket, tmp_path: Path, sign: bytes) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as out:
        out.sendto(sign, str(tmp_path / "s"))
    assert signs.take() == set()


def test_a_watcher_that_stands_still_holds_nobody_up(signs: SignSocket, tmp_path: Path) -> None:
    sender = Notify(str(tmp_path / "s"))
    for _ in range(SIGNS_MAX):  # far more than the kernel queues: a blocking send would hang here
        sender.alive()
    assert signs.take() == {os.getpid()}


def test_a_later_socket_takes_the_place_of_an_earlier_one(signs: SignSocket, tmp_path: Path) -> None:
    later = SignSocket(tmp_path / "s")
    Notify(str(tmp_path / "s")).alive()
    assert (later.take(), signs.take()) == ({os.getpid()}, set())


def test_a_folder_that_cannot_be_written_to_is_refused(tmp_path: Path) -> None:
    with pytest.raises(Refused, match="must be in a folder to write to"):
        SignSocket(tmp_path / "absent" / "s")
