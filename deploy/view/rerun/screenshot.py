"""Screenshot of a recording without a display: by rerun's viewer on a virtual screen, or drawn by `catalogue.py`.

The viewer needs a screen (Xvfb suffices) and Vulkan (Mesa's software driver suffices). If they are missing, the same
layout is drawn without the viewer, and the output line states it.
"""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from lfa.deploy.view.rerun.viewer import quiet, viewer_path
from lfa.deploy.whole_output import whole_file
from lfa.protocol.errors import Refused

SIZE, SCALE = "1600x1000", "2"
"""Window size in the toolkit's points, and pixels per point, which would else depend on the screen's density."""
SCREEN = "6600x4200x24"
"""Size and depth of the virtual screen: so large that the pointer, at its centre, is outside the window: no tooltip."""
SHOT_S_MAX = 300.0
LAYOUT_AT_END = ".rbl"
"""Suffix of the layout that shows the end of a recording, for a picture; the recording's own layout plays it."""


def take(rrd: Path, picture: Path, folder: Path | None) -> str:
    """Write `picture` of `rrd` and return a line with its path and the tool that drew it. Raises Refused."""
    if picture.suffix != ".png" or not picture.resolve().parent.is_dir():
        raise Refused(f"--screenshot {picture}: must be a .png in a folder that exists")
    complaint = _by_viewer(rrd, picture)
    if complaint is None:
        return f"{picture} (rerun's viewer)"
    if folder is None:
        raise Refused(f"--screenshot {picture}: {complaint}")
    from lfa.deploy.analysis.run_data import Run
    from lfa.deploy.view.figures import catalogue

    with whole_file(picture) as fresh:
        fresh.write_bytes(catalogue.png(catalogue.overview(Run(folder))))
    return f"{picture} (drawn without the viewer: {complaint})"


def _by_viewer(rrd: Path, picture: Path) -> str | None:
    """Draw with rerun's viewer; return None on success, else the reason of the failure."""
    with _screen() as display:
        if display is None:
            return "no display, and no Xvfb on the PATH"
        picture.unlink(missing_ok=True)
        at_end = rrd.with_suffix(LAYOUT_AT_END)
        files = [str(rrd), *([str(at_end)] if at_end.is_file() else [])]
        command = [viewer_path(), *files, "--screenshot-to", str(picture), "--window-size", SIZE, "--port", "auto"]
        try:
            subprocess.run(
                command,
                env=quiet() | {"DISPLAY": display, "WINIT_X11_SCALE_FACTOR": SCALE},
                timeout=SHOT_S_MAX,
                capture_output=True,
                check=True,
            )
        except subprocess.TimeoutExpired:
            return f"the viewer took no picture within {SHOT_S_MAX:g} s"
        except (OSError, subprocess.CalledProcessError):
            return "the viewer cannot draw here (it needs Vulkan or OpenGL)"
    return None if picture.is_file() else "the viewer took no picture"


@contextmanager
def _screen() -> Iterator[str | None]:
    """Yield a display: the present one, else a temporary virtual one, else None."""
    present = os.environ.get("DISPLAY")
    xvfb = shutil.which("Xvfb")
    if present or xvfb is None:
        yield present
        return
    ours, theirs = os.pipe()
    command = [xvfb, "-displayfd", str(theirs), "-screen", "0", SCREEN, "-nolisten", "tcp"]
    server = subprocess.Popen(command, pass_fds=[theirs], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    os.close(theirs)
    try:
        with os.fdopen(ours) as answer:
            number = answer.readline().strip()
        yield f":{number}" if number else None
    finally:
        server.terminate()
        server.wait()
