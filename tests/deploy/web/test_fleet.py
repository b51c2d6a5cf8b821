"""The page on a fleet of real processes: what is clicked happens to them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from lfa.deploy.bench.harness.browser import Browser, chromium
from tests.rigs.lfa_runs import Running, eventually, lfa, running
from tests.rigs.web_page import place, served

pytestmark = [
    pytest.mark.skipif(chromium() is None, reason="no Chromium"),
    pytest.mark.processes,
    pytest.mark.xdist_group("web"),
]
SPEEDS = "[...lfa.models[0].robots.values()].map((robot) => Math.abs(robot.speed))"
ROLE = "lfa.models[0].robots.get({}).role === '{}'"


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    setting = ("--set", "time_limit_s=120.0", "--set", "mission.leading.cruise_mps=0.2")
    with running(tmp_path_factory.mktemp("web") / "run", "straight", *setting) as run:
        run.wait_for("leader_command")
        yield run


@pytest.fixture(scope="module")
def page(fleet: Running) -> Iterator[Browser]:
    with served("--fleet", f"straight-{fleet.launcher.pid}") as server, Browser() as browser:
        browser.open(server.operate)
        browser.wait_for("lfa.models.length && lfa.models[0].robots.size === 4 && lfa.models[0].leader")
        yield browser
        assert browser.errors == []
        browser.open("about:blank")


def do(page: Browser, robot: int, action: str) -> None:
    """Follow a robot, so that it stays where it is clicked, and choose from its menu."""
    page.value(f"lfa.stages[0].chosen = {robot}, lfa.stages[0].following = true")
    page.wait_for(f"Math.abs(lfa.stages[0].camera.x - lfa.models[0].robots.get({robot}).x) < 0.2")
    page.click_at(*place(page, robot))
    page.wait_for(f"lfa.chosen === {robot}")
    page.click(f"#do-{action}")


def test_a_robot_clicked_frozen_is_stopped_and_goes_on(page: Browser, fleet: Running) -> None:
    do(page, 3, "stop")
    page.wait_for(ROLE.format(3, "stopped"))
    pid = fleet.group()["robot3"].pid
    eventually(lambda: Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "T", "it is not stopped")
    do(page, 3, "continue")
    page.wait_for("['follower', 'leader'].includes(lfa.models[0].robots.get(3).role)")


def test_orders_reach_the_fleet(page: Browser, fleet: Running) -> None:
    page.click("#side-column")
    page.wait_for("lfa.models[0].log.some((e) => e.kind === 'formation' && e.text.includes('column'))")
    do(page, 4, "cut")
    page.wait_for("lfa.models[0].robots.get(4).cut === 1")
    page.click("#healall")
    page.wait_for("lfa.models[0].robots.get(4).cut === 0")
    page.value("lfa.order({do: 'fault', text: 'obstacle 30,3,0.4'})")
    page.wait_for("lfa.models[0].added.length === 1")
    ordered = {"formation", "cut", "heal", "obstacle"}
    eventually(
        lambda: ordered <= {e.get("deed") for e in fleet.events() if e["kind"] == "fault"}, "an order is not recorded"
    )


def test_the_range_slider_takes_the_leader_from_those_who_are_farther_away_until_it_is_let_go(page: Browser) -> None:
    slide = "s.dispatchEvent(new Event('input')), s.dispatchEvent(new Event('change'))"
    page.value(f"((s) => {{ s.value = 2; {slide} }})(document.getElementById('range'))")
    page.wait_for("[...lfa.models[0].robots.values()].some((robot) => robot.role === 'waiting')")
    page.value(f"((s) => {{ s.value = 0; {slide} }})(document.getElementById('range'))")
    page.wait_for("[...lfa.models[0].robots.values()].filter((robot) => robot.role === 'follower').length === 3")


def test_a_clicked_goal_is_carried_out_and_an_impossible_one_refused(page: Browser) -> None:
    page.value("lfa.order({do: 'fault', text: 'goal 20,2'})")
    page.wait_for("lfa.models[0].goal.join() === '20,2'")
    page.wait_for("lfa.models[0].log.some((e) => e.text.startsWith('goal 20,2: order 1 carried out by robot'))")
    page.value("lfa.order({do: 'fault', text: 'goal 20,nan'})")
    page.wait_for("document.getElementById('said').textContent.includes('must be x and y')")


def test_a_scan_is_shown_while_it_is_asked_for(page: Browser) -> None:
    do(page, 2, "scan")
    page.wait_for("lfa.models[0].scans[2]?.[2].length === 180")
    page.value("lfa.controls.scan(2), 0")
    page.wait_for("lfa.models[0].scans[2] === undefined")


def test_the_stop_button_stops_all_and_says_so(page: Browser) -> None:
    page.wait_for(f"{SPEEDS}.some((speed) => speed > 0.05)")
    page.click("#stop")
    page.wait_for("lfa.models[0].log.some((e) => e.text.startsWith('stopped: robot1, robot2, robot3, robot4'))")
    page.wait_for(f"{SPEEDS}.every((speed) => speed < 0.001)")
    page.click("#resume")
    page.wait_for(f"{SPEEDS}.some((speed) => speed > 0.05)")


def test_a_robot_clicked_dead_dies_and_starts_again(page: Browser, fleet: Running) -> None:
    leader = page.wait_for("lfa.models[0].leader")
    pid = fleet.group()[f"robot{leader}"].pid
    do(page, leader, "kill")
    page.wait_for(f"lfa.models[0].leads.some((lead) => lead.why === 'robot {leader} was killed')")
    eventually(lambda: not Path(f"/proc/{pid}/exe").exists(), "it is not killed")
    page.wait_for(ROLE.format(leader, "gone"))
    do(page, leader, "restart")
    page.wait_for(f"!['gone', 'waiting'].includes(lfa.models[0].robots.get({leader}).role)")


def test_no_fleet_is_told_in_one_line() -> None:
    done = lfa("web", "--port", "0", "--fleet", "none_such", "--connect", "unixsock-stream//nowhere/z.sock")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
