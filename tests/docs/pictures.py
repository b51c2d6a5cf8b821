"""The pictures of the pages, made anew by the tools that they show: `make pictures`, some of them: PICTURES='view web'.

A report and `lfa web` are opened in Chromium, a recording in rerun's viewer, which needs a display (Xvfb suffices) and
Vulkan (Mesa's software driver suffices). Look at what was made before it is committed.
"""

from __future__ import annotations

import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image

from lfa.deploy.bench.harness.browser import Browser
from tests.rigs.web_page import served
from tests.test_imports import ROOT

LFA = Path(sys.executable).with_name("lfa")
BUILD = ROOT / "build/pictures"
TUTORIAL, VIEWS = ROOT / "deploy/docs/pictures", ROOT / "deploy/view/pictures"
RUNS = {
    "tutorial": "leader_killed --seed 7 --figures",
    "view": "paper_path1 --seed 7 --fault 'kill leader at 20 s'",
    "explore": "explore --seed 7",
    "fifty": "straight --robots 50 --set time_limit_s=40 --set mission.control_hz=20 --set world.lidar.beams=90",
}
"""What `lfa sim` is told for each run folder; one that is there is taken as it is."""
FIGURES = ("fig07_distance_error", "fig09_path_flow", "lease_timeline")
WIDTH_PX = 1280
"""Width of a picture of rerun's viewer, which draws twice as large, so that lines come out smooth."""
PAGE_PX = (1100, 1500)
COMMON, RARE = 160, 96
"""Colours of a picture: those of its areas, and those that few pixels have, as a legend's."""


def lfa(command: str) -> int:
    """Run a command of `lfa` and return its exit code."""
    print("lfa", command, flush=True)
    return subprocess.run([LFA, *shlex.split(command)], cwd=BUILD, stdout=subprocess.DEVNULL).returncode


def run_of(name: str) -> Path:
    """Return the run folder of that name, made if it is not there."""
    folder = BUILD / name
    if not folder.is_dir():
        lfa(f"sim {RUNS[name]} --out {name}")
    return folder


def keep(drawn: Path, picture: Path, width: int | None = None) -> None:
    """Write `drawn` as a small PNG with a palette that holds its rare colours, too."""
    image = Image.open(drawn).convert("RGB")
    if width is not None:
        image = image.resize((width, image.height * width // image.width), Image.Resampling.LANCZOS)
    none = Image.Dither.NONE
    parts = (image.quantize(COMMON, Image.Quantize.MEDIANCUT), image.quantize(RARE, Image.Quantize.MAXCOVERAGE))
    palette = Image.new("P", (1, 1))
    palette.putpalette([value for part in parts for value in part.getpalette() or []])
    image.quantize(palette=palette, dither=none).save(picture, optimize=True)
    print(picture.relative_to(ROOT), f"{picture.stat().st_size / 1e3:.0f} kB", flush=True)


def tutorial() -> None:
    """Draw the tutorial's run: a film, figures, and its report."""
    run = run_of("tutorial")
    lfa(f"view tutorial --gif {shlex.quote(str(TUTORIAL / 'killed.gif'))}")
    for name in FIGURES:
        shutil.copy(run / f"figures/{name}.png", TUTORIAL)
    report("tutorial", TUTORIAL / "report.png")


def report(name: str, picture: Path) -> None:
    """Open the report of a run in a browser."""
    page = run_of(name) / "report.html"
    lfa(f"report {name}")
    with Browser(*PAGE_PX) as browser, TemporaryDirectory() as place:
        browser.open(page.as_uri())
        browser.wait_for("document.querySelector('.uplot canvas')")
        browser.picture(Path(place, "page.png"))
        keep(Path(place, "page.png"), picture)


def view(name: str) -> None:
    """Open a recording in rerun's viewer, at its end."""
    run_of(name)
    with TemporaryDirectory() as place:
        drawn = Path(place, "view.png")
        done = subprocess.run(
            [LFA, "view", str(BUILD / name), "--screenshot", str(drawn)], capture_output=True, text=True
        )
        if "(rerun's viewer)" not in done.stdout:
            raise SystemExit(f"{name}: {done.stdout}{done.stderr}")
        keep(drawn, VIEWS / f"{name}.png", WIDTH_PX)


def web() -> None:
    """Open the page of a team at the end of its lesson, two seconds after the leader was killed."""
    with served() as server, Browser() as browser, TemporaryDirectory() as place:
        browser.open(server.operate)
        browser.wait_for("lfa.models[0].robots.size === 4")
        browser.value("lfa.theme('dark'), lfa.order({do: 'lesson', key: 'killed'})")
        browser.wait_for(
            "document.getElementById('lessondone')",
            meanwhile=lambda: browser.value("document.getElementById('show')?.click()"),
        )
        browser.wait_for("lfa.models[0].t > 9")
        browser.picture(Path(place, "web.png"))
        keep(Path(place, "web.png"), VIEWS / "web.png")


PICTURES: dict[str, Callable[[], None]] = {
    "tutorial": tutorial,
    "view": lambda: view("view"),
    "report": lambda: report("view", VIEWS / "report.png"),
    "explore": lambda: view("explore"),
    "fifty": lambda: view("fifty"),
    "web": web,
}


def main(names: list[str]) -> None:
    """Make the named pictures, by default all."""
    BUILD.mkdir(parents=True, exist_ok=True)
    for name in names or PICTURES:
        PICTURES[name]()


if __name__ == "__main__":
    main(sys.argv[1:])
