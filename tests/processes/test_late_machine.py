"""A process that its machine keeps late again and again steps less often, says so, and keeps its place in the team."""

from __future__ import annotations

import signal

import pytest

from lfa.deploy.bench.harness.team import Team, endless
from lfa.protocol import clock
from lfa.protocol.messages.team import Level
from lfa.protocol.names import robot_name
from tests.rigs.live_team import pass_time

pytestmark = pytest.mark.processes

ROBOTS, LATE, WHOLE_S = 3, 2, 40.0
STOPPED_S, RUNS_S = 0.12, 0.06
"""Times [s] for which the process is stopped, and runs between: a lease bears it, a command's age just so."""


def test_a_late_process_steps_less_often_and_nobody_loses_the_lease() -> None:
    with Team(endless(ROBOTS, "auto")) as live:
        chain = live.await_chain(ROBOTS, WHOLE_S)
        began = clock.now()
        live.heard.events.clear()
        while not _says_lower_rate(live):
            assert clock.now() < began + WHOLE_S, "its status names no lower rate"
            live.signal(LATE, signal.SIGSTOP)
            pass_time(live, STOPPED_S)
            live.signal(LATE, signal.SIGCONT)
            pass_time(live, RUNS_S)
        live.wait_until(lambda: _back(live), "it does not step as before", WHOLE_S)
        assert live.await_chain(ROBOTS, WHOLE_S) == chain
        assert not [event for event in live.heard.events if event.kind == "lease"]


def _says_lower_rate(live: Team) -> bool:
    heard = live.heard.state.status.get(robot_name(LATE))
    return heard is not None and heard.message.level is Level.WARN and "control at 25 Hz" in heard.message.text


def _back(live: Team) -> bool:
    rates = [event for event in live.heard.events if event.kind == "rate" and event.header.sender == robot_name(LATE)]
    return bool(rates) and rates[-1].data["late"] is False
