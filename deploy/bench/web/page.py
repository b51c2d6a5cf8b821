"""`lfa bench web`: how soon the page shows, how smoothly it draws, what a viewer costs, and how soon a click kills."""

from __future__ import annotations

import os
import select
import statistics
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from time import perf_counter

from lfa.deploy.bench.harness.child_process import cpu_s
from lfa.deploy.bench.harness.rows import BenchRow, Quantity, row, show
from lfa.deploy.bench.harness.team import Team
from lfa.deploy.client.discovery import agents
from lfa.protocol import clock
from lfa.protocol.names import robot_id_of
from lfa.world.description.load import load

ROBOTS, VIEWERS = 50, 5
WATCHED_S, ELECTED_S_MAX = 4.0, 60.0
LAG_S, LOOK_S = 10.0, 0.2
"""Time [s] for which the agents' loop lag is noted, and between two looks."""
LAG_MS_LEAST = 1.0
"""Loop lag [ms] below which the ratio says nothing: a machine's timer is no finer."""
PAGE = Path(__file__).parents[2] / "web" / "page"
FIRST = Quantity("first frame", "s", 1.0)
SIZE = Quantity("size of the page", "MB", 1.0)
FPS = Quantity("frames a second", "Hz", 50.0, "at least")
SPEED = Quantity("virtual time over real time, while it is watched", "ratio")
COST = Quantity("server's CPU for each viewer", "%", 5.0)
LAG = Quantity("loop lag, 5 viewers over nobody", "ratio", 1.5)
ALONE = Quantity("loop lag, nobody looks", "ms", 20.0)
LOOKED_AT = Quantity("loop lag, 5 viewers", "ms", 20.0)
KILL = Quantity("click to SIGKILL", "ms", 100.0)
SHOWN = "window.lfa && lfa.models.length && lfa.models[0].robots.size === {}"


def run(as_json: bool) -> int:
    """Print the rows; return 0 if all hold, else 1. Raises Refused without Chromium."""
    return show(_rows(), as_json)


def _rows() -> Iterator[list[BenchRow]]:
    from lfa.deploy.bench.harness.browser import Browser  # needs the extra `web`

    yield [row("page", SIZE, sum(path.stat().st_size for path in PAGE.iterdir()) / 1e6)]
    with _served("straight", "--robots", str(ROBOTS)) as (address, server), Browser() as browser:
        began = perf_counter()
        browser.open(address)
        browser.wait_for(SHOWN.format(ROBOTS))
        yield [row(f"{ROBOTS} robots", FIRST, perf_counter() - began)]
        browser.value("lfa.order({do: 'play'})")
        browser.wait_for("lfa.models[0].leader", ELECTED_S_MAX)  # an election costs more than driving
        before_s, began = browser.value("lfa.models[0].t"), perf_counter()
        clock.sleep(WATCHED_S)
        reached = (browser.value("lfa.models[0].t") - before_s) / (perf_counter() - began)
        yield [row(f"{ROBOTS} robots", FPS, browser.value("lfa.fps.value")), row(f"{ROBOTS} robots", SPEED, reached)]
        browser.value("lfa.order({do: 'pause'})")
        alone = _cost(server)
        with _viewers(address):
            together = _cost(server)
        yield [row(f"{VIEWERS} more viewers", COST, 100.0 * (together - alone) / VIEWERS)]
    with Team(load("straight")) as team:
        team.await_chain(len(team.scenario.mission.robots))
        before_ms = _lag_ms(team)
        with _served("--fleet", team.fleet.name) as (address, _), _viewers(address):
            looked_at_ms = _lag_ms(team)
        ratio = looked_at_ms / max(before_ms, LAG_MS_LEAST)
        yield [row("fleet", ALONE, before_ms), row("fleet", LOOKED_AT, looked_at_ms), row("fleet", LAG, ratio)]
        with _served("--fleet", team.fleet.name) as (address, _), Browser() as browser:
            browser.open(address)
            browser.wait_for(SHOWN.format(len(team.scenario.mission.robots)))
            victims = [agent for agent in agents() if agent.fleet == team.fleet.name and agent.robot > 2]
            times = []
            for victim in victims:
                gone = os.pidfd_open(victim.identity.pid)
                began = perf_counter()
                browser.value(f"lfa.order({{do: 'fault', text: 'kill {victim.robot}'}})")
                select.select([gone], [], [], 10.0)
                times.append(1000.0 * (perf_counter() - began))
                os.close(gone)
            yield [row("fleet", KILL, statistics.median(times))]


@contextmanager
def _served(*arguments: str) -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    """Run `lfa web` and yield the address to operate it, and its process."""
    command = [sys.executable, "-P", "-c", "from lfa.deploy.cli import main; main()", "web", *arguments, "--port", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        try:
            yield process.stdout.readline().decode().split()[-1], process
        finally:
            process.terminate()


def _cost(process: subprocess.Popen[bytes]) -> float:
    """Return the share of a core that a process uses for a while."""
    before, began = cpu_s(process), perf_counter()
    clock.sleep(WATCHED_S)
    return (cpu_s(process) - before) / (perf_counter() - began)


def _lag_ms(team: Team) -> float:
    """Return the median [ms] of the loop lags that a team's agents report for each second of `LAG_S`."""
    heard: dict[tuple[str, int], float] = {}
    until = clock.now() + LAG_S
    while clock.now() < until:
        team.listen()
        for name, status in team.heard.state.status.items():
            if robot_id_of(name):
                heard[name, status.message.header.seq] = status.message.counters.get("loop_lag_ms", 0.0)
        clock.sleep(LOOK_S)
    return statistics.median(heard.values())


@contextmanager
def _viewers(address: str) -> Iterator[None]:
    """Have `VIEWERS` more viewers take what the server sends."""
    from websockets.sync.client import connect
    from websockets.typing import Origin

    base, _, token = address.partition("/?")
    with ExitStack() as opened:
        sockets = [
            opened.enter_context(
                connect(f"{base.replace('http', 'ws')}/ws?{token}", origin=Origin(base), compression=None)
            )
            for _ in range(VIEWERS)
        ]
        for socket in sockets:
            threading.Thread(target=lambda taken=socket: [None for _ in taken], daemon=True).start()
        yield
