"""The driver's watchdog process: it stops the motors when the driver dies or hangs, and not while it lives."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from lfa.deploy.robot import watchdog
from lfa.deploy.robot.watchdog import SILENT_S, STOPS_MAX, stop_by, watch
from lfa.protocol.errors import Refused
from tests.rigs.lfa_runs import eventually

pytestmark = pytest.mark.processes

DRIVER = """
import sys, time
from lfa.deploy.robot.watchdog import Watchdog
dog = Watchdog([sys.executable, "-c", "open(%r, 'a').write('stop ')"])
for n in range(int(sys.argv[1])):
    dog.alive(0.0)
    if n == 20:
        print("drives", flush=True)
    time.sleep(0.02)
"""
FOR_EVER, HALF_A_MINUTE = "100000", "1500"


def _driver(place: Path, periods: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-P", "-c", DRIVER % str(place / "stopped"), periods]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)


def _stops(place: Path) -> int:
    path = place / "stopped"
    return path.read_text().count("stop") if path.exists() else 0


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGSTOP])
def test_a_driver_that_is_killed_or_hangs_has_its_motors_stopped(number: signal.Signals, tmp_path: Path) -> None:
    with _driver(tmp_path, FOR_EVER) as driver:
        assert driver.stdout is not None
        assert driver.stdout.readline() == "drives\n"
        assert _stops(tmp_path) == 0, "a driver that lives is left alone"
        os.kill(driver.pid, number)
        eventually(lambda: _stops(tmp_path) == 1, "nobody stopped the motors")
        driver.kill()


def test_a_driver_that_ends_has_its_motors_stopped(tmp_path: Path) -> None:
    with _driver(tmp_path, "30"):
        eventually(lambda: _stops(tmp_path) == 1, "nobody stopped the motors")


def _watched(*codes: int, ends: bool) -> int:
    """Number of stops at a driver that reported once, and then is silent or `ends`; `codes` are those of the stops."""
    pipe, driver = os.pipe()
    left, calls = list(codes), 0
    os.write(driver, b".")
    if ends:
        os.close(driver)

    def stop() -> int:
        nonlocal calls
        calls += 1
        code = left.pop(0) if left else 0
        if code == 0 and not ends and calls == len(codes) + 1:
            os.close(driver)  # so that the watchdog ends too: it stops once more
        return code

    watch(pipe, 0.01, stop)
    os.close(pipe)
    return calls


@pytest.mark.parametrize("failures", [0, 1, 3])
def test_a_stop_that_fails_is_repeated_until_it_works(failures: int) -> None:
    assert _watched(*[1] * failures, ends=True) == failures + 1
    assert _watched(*[1] * failures, ends=False) == failures + 2, "at the silence, and at the end"
    assert _watched(*[1] * 1000, ends=True) == STOPS_MAX


def test_a_stop_that_hangs_or_is_missing_has_failed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(watchdog, "STOP_S_MAX", 0.1)
    assert stop_by([sys.executable, "-c", "import time; time.sleep(60)"]) == 1
    assert stop_by(["no-such-command"]) == 1
    assert stop_by(["true"]) == 0


def test_a_driver_whose_watchdog_has_ended_ends_with_a_line() -> None:
    dog = watchdog.Watchdog(["true"])
    dog._process.kill()
    dog._process.wait()
    with pytest.raises(Refused, match="the watchdog process has ended"):
        dog.alive(0.0)


def test_the_silence_that_is_waited_for_is_a_quarter_of_a_second() -> None:
    assert SILENT_S == 0.25
