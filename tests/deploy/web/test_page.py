"""The page in a real browser on teams in virtual time: each control does what it says, each lesson ends as told."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from lfa.deploy.bench.harness.browser import Browser, chromium
from lfa.deploy.web.lessons import LESSONS, Lesson
from tests.rigs.web_page import Served, place, point, served

pytestmark = [
    pytest.mark.skipif(chromium() is None, reason="no Chromium"),
    pytest.mark.processes,
    pytest.mark.xdist_group("web"),
]
SIZES = {"projector": (1920, 1080), "laptop": (1366, 768), "phone": (390, 844)}
FREE = "#run=leader_killed&set=faults%3D%5B%5D"
FAST = "lfa.order({do: 'speed', value: 1000})"


@pytest.fixture(scope="module")
def server() -> Iterator[Served]:
    with served() as running:
        yield running


@pytest.fixture(scope="module")
def tab() -> Iterator[Browser]:
    with Browser() as browser:
        yield browser


@pytest.fixture
def page(server: Served, tab: Browser) -> Iterator[Browser]:
    """The page on a team that nothing has been done to yet; the console stays empty."""
    tab.errors.clear()
    tab.size(*SIZES["laptop"])
    tab.open("about:blank")
    tab.open(server.operate + FREE)
    tab.wait_for("lfa.state.link === 'run=leader_killed&set=faults%3D%5B%5D' && lfa.models[0].robots.size === 4")
    yield tab
    assert tab.errors == []


def led(page: Browser, robot: int = 1) -> None:
    page.value(f"lfa.order({{do: 'play'}}), {FAST}")
    page.wait_for(f"lfa.models[0].leader === {robot}")


def choose(page: Browser, robot: int) -> None:
    """Click a robot where it is drawn; the run stands still meanwhile, or the robot would drive away."""
    page.value("lfa.order({do: 'pause'})")
    page.wait_for("!lfa.state.playing && performance.now() - lfa.models[0].arrived > 300")
    page.click_at(*place(page, robot))
    page.wait_for(f"lfa.chosen === {robot}")


def action(name: str, robot: int) -> Callable[[Browser], None]:
    def do(page: Browser) -> None:
        choose(page, robot)
        page.click(f"#do-{name}")
        page.value("lfa.order({do: 'play'})")

    return do


def slide(name: str, value: float) -> Callable[[Browser], None]:
    """Set a slider as a person does: its value, then the event that letting go sends."""
    return lambda page: page.value(
        f"(() => {{ const s = document.getElementById('{name}'); s.value = {value};"
        " s.dispatchEvent(new Event('input')); s.dispatchEvent(new Event('change')) })()"
    )


def click(selector: str) -> Callable[[Browser], None]:
    return lambda page: page.click(selector)


def press(key: str) -> Callable[[Browser], None]:
    return lambda page: page.press(key)


def wait(expression: str) -> Callable[[Browser], None]:
    return lambda page: page.wait_for(expression)


def run(code: str) -> Callable[[Browser], None]:
    return lambda page: page.value(f"{code}, 0")


ROLE = "lfa.models[0].robots.get({}).role === '{}'"
PAUSED = "!lfa.state.playing && (window.t0 = lfa.models[0].t)"
LOST = "lfa.state.loss === 0.3 && [...lfa.models[0].robots.values()].some((r) => r.loss > 0.1)"
COLUMN = "lfa.models[0].log.some((e) => e.kind === 'formation' && e.text.includes('column'))"
STEPPED = "lfa.models[0].t > window.t0 + 0.09 && lfa.models[0].t < window.t0 + 0.2"
THEME = "document.documentElement.dataset.theme"
#            control             what is done                             the JavaScript that then becomes true
CONTROLS: dict[str, tuple[list[Callable[[Browser], None]], str]] = {
    "kill":            ([action("kill", 3)],                        ROLE.format(3, "gone")),
    "kill the leader": ([action("kill", 1)],                        "lfa.models[0].leader === 2"),
    "freeze":          ([action("stop", 2)],                        ROLE.format(2, "stopped")),
    "continue":        ([action("stop", 3), action("continue", 3)],   ROLE.format(3, "follower")),
    "cut":             ([action("cut", 4)],                         "lfa.models[0].robots.get(4).cut === 1"),
    "heal":            ([action("cut", 4), action("heal", 4)],        "lfa.models[0].robots.get(4).cut === 0"),
    "heal all":        ([action("cut", 4), click("#healall")],      "lfa.models[0].robots.get(4).cut === 0"),
    "restart":         ([action("kill", 4), action("restart", 4)],    ROLE.format(4, "follower")),
    "loss":            ([slide("loss", 0.3)],                     LOST),
    "range":           ([slide("range", 5)],                      "lfa.state.range === 5"),
    "formation":       ([click("#side-column")],                  COLUMN),
    "play and pause":  ([click("#play")],                         "!lfa.state.playing"),
    "step":            ([click("#play"), wait(PAUSED), click("#step")], STEPPED),
    "again":           ([click("#again")],                        "lfa.models[0].t < 0.1 && !lfa.state.playing"),
    "keys":            ([press("]"), wait("lfa.chosen === 1"), press("k")], "lfa.models[0].leader === 2"),
    "theme":           ([run(f"window.before = {THEME}"), press("t")], f"{THEME} !== window.before"),
    "follow":          ([click("#follow")], "lfa.stages[0].camera.x > 1 && lfa.stages[0].following"),
    "scan":            ([lambda page: choose(page, 2), click("#do-scan")], "lfa.models[0].scans[2][2].length === 180"),
}  # fmt: skip


def on_ground(x: float, y: float, button: str) -> Callable[[Browser], None]:
    """Click the ground at a place [m] and choose from its menu; the run stands still meanwhile."""

    def do(page: Browser) -> None:
        page.value("lfa.order({do: 'pause'})")
        page.wait_for("!lfa.state.playing")
        page.click_at(*point(page, x, y))
        page.click(button)
        page.value("lfa.order({do: 'play'})")

    return do


GIVEN = "lfa.models[0].goal.join() === '3,2.5' && lfa.state.faults[0].startsWith('goal 3.00,2.50 at ')"
TAKEN = f"{GIVEN} && lfa.models[0].log.some((e) => e.text.startsWith('order') && e.text.includes('by leader'))"
FOCUSED = wait("document.activeElement.id === 'do-goal'")
CONTROLS |= {
    "goal":             ([on_ground(3.0, 2.5, "#do-goal")],       TAKEN),
    "obstacle by menu": ([on_ground(3.0, 2.5, "#do-obstacle")],   "lfa.models[0].added[0].radius_m === 0.25"),
    "goal by keys":     ([press("g"), FOCUSED, run("document.activeElement.click()")], "lfa.state.faults.length === 1"),
}  # fmt: skip


@pytest.mark.parametrize("control", CONTROLS)
def test_a_control_does_what_it_says(page: Browser, control: str) -> None:
    led(page)
    actions, seen = CONTROLS[control]
    for do in actions:
        do(page)
    page.wait_for(seen)


def test_a_drawn_obstacle_is_met(page: Browser) -> None:
    led(page)
    page.value("lfa.order({do: 'pause'})")
    page.click("#draw")
    page.drag([point(page, 4.0, 0.0), point(page, 4.2, 0.0), point(page, 4.4, 0.0)])
    page.value("lfa.order({do: 'play'})")
    page.wait_for("lfa.models[0].added.length === 1 && lfa.models[0].added[0].radius_m > 0.3")
    page.wait_for("lfa.models[0].log.some((e) => e.kind === 'decision' && e.who === 1)")


def test_an_obstacle_on_a_robot_is_refused_in_one_line_and_the_run_goes_on(page: Browser) -> None:
    led(page)
    page.click("#draw")
    page.click_at(*place(page, 2))
    page.wait_for("document.getElementById('said').textContent.includes('robot 2 stands there')")
    before = page.value("lfa.models[0].t")
    page.wait_for(f"lfa.models[0].t > {before} + 0.5")


def test_what_was_clicked_is_in_the_link_and_in_the_saved_scenario(page: Browser) -> None:
    led(page)
    action("kill", 3)(page)
    page.wait_for(ROLE.format(3, "gone"))
    page.value("URL.createObjectURL = (blob) => { blob.text().then((text) => (window.saved = text)); return '#' }, 0")
    page.click("#save")
    fault = page.wait_for("window.saved && window.saved.match(/faults = (.*)/)[1]")
    page.click("#share")
    assert page.value("new URLSearchParams(location.hash.slice(1)).get('fault')") in fault
    assert "kill 3 at " in fault


@pytest.mark.parametrize("lesson", LESSONS, ids=lambda lesson: lesson.key)
def test_a_lesson_ends_as_told(page: Browser, lesson: Lesson) -> None:
    page.value(f"lfa.order({{do: 'lesson', key: '{lesson.key}'}})")
    page.wait_for("lfa.state.step === 0")
    page.value(FAST)

    def go_on() -> None:
        page.value("document.getElementById('show')?.click()")

    page.wait_for("document.getElementById('lessondone')", 90.0, go_on)
    assert page.value("lfa.state.step") == len(lesson.steps)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("theme", ["light", "dark"])
def test_nothing_sticks_out_in_any_size_and_theme(page: Browser, size: str, theme: str, tmp_path: Path) -> None:
    page.size(*SIZES[size], touch=size == "phone")
    led(page)
    page.value(f"lfa.theme('{theme}')")
    page.wait_for("lfa.models[0].t > 3")
    assert page.value("[innerWidth, document.documentElement.scrollWidth]") == [SIZES[size][0]] * 2
    keep = os.environ.get("LFA_PICTURES")
    page.picture(Path(keep or tmp_path) / f"web_{size}_{theme}.png")
