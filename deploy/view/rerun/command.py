"""`lfa view`: show a recording or a running fleet in the rerun viewer, in a browser, or as a picture."""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lfa.deploy.client.operator import Operator
from lfa.deploy.client.session import FleetAddress, find, listen, scenario_of_fleet
from lfa.deploy.recording.recorder import parts
from lfa.deploy.recording.simulation_time import WorldTime
from lfa.deploy.terminal_text import print_visible
from lfa.deploy.whole_output import whole_file
from lfa.protocol import clock, incarnations
from lfa.protocol.errors import Refused
from lfa.protocol.messages.simulation import Truth
from lfa.protocol.output import write_line
from lfa.protocol.topics import address
from lfa.protocol.transport.message_bus import send

if TYPE_CHECKING:
    import rerun

    from lfa.world.description.scenario import Scenario
from lfa.deploy.view.rerun.screenshot import LAYOUT_AT_END
from lfa.deploy.view.rerun.viewer import (
    await_end,
    check_free_port,
    data_address,
    end,
    has_display,
    need_rerun,
    run_viewer,
    serve,
)

RRD = "recording.{}.rrd"
"""Name of the converted recording, with the hash of the code that converted it: another version converts it anew."""
PICTURE = "view.png"
FLUSH_S = 0.33  # the cost of a batch depends little on its size: at 0.1 s the total would be more than twice as high
PORT, WEB_PORT = 9876, 9090
SHOW_EVERY_S = 3.0  # wall-clock time between two lines of progress
SHOT_S = 5.0  # time drawn of a running fleet before its picture is taken


def command(
    folder: Annotated[Path | None, typer.Argument(metavar="[RUN]", help="Run folder; default a running fleet.")] = None,
    fleet: Annotated[str | None, typer.Option(help="Name of the fleet; required when several run here.")] = None,
    connect: Annotated[str | None, typer.Option(help="Endpoint of a router; default the fleet's own here.")] = None,
    keys: Annotated[Path | None, typer.Option(help="Folder written by lfa keys, for a secured fleet.")] = None,
    serve_web: Annotated[bool, typer.Option("--serve-web", help="Serve the viewer to a browser.")] = False,
    screenshot: Annotated[Path | None, typer.Option(help="Write a PNG and exit; needs no display.")] = None,
    html: Annotated[Path | None, typer.Option(help="Write one HTML file that plays RUN, for anybody to open.")] = None,
    gif: Annotated[Path | None, typer.Option(help="Write a film of RUN as a GIF.")] = None,
    mp4: Annotated[Path | None, typer.Option(help="Write a film of RUN as an MP4; needs ffmpeg.")] = None,
    port: Annotated[int, typer.Option(help="Port for the data of viewers.")] = PORT,
    web_port: Annotated[int, typer.Option(help="Port for the viewer in a browser.")] = WEB_PORT,
) -> int:
    if html is not None or gif is not None or mp4 is not None:
        return _write_clip(folder, html, gif, mp4)
    need_rerun()
    if serve_web:
        check_free_port(port, "--port")
        check_free_port(web_port, "--web-port")
    if folder is None:
        return _live(find(fleet, connect, keys), serve_web, screenshot, port, web_port)
    rrd = converted(folder)
    if screenshot is None and not serve_web and not has_display():
        print_visible(
            "no display here: a picture instead (--serve-web shows it in a browser)", file=sys.stderr, flush=True
        )
        screenshot = folder / PICTURE
    if screenshot is not None:
        from lfa.deploy.view.rerun.screenshot import take

        print_visible(take(rrd, screenshot, folder))
        return 0
    print_visible(rrd, flush=True)
    if serve_web:
        return await_end(serve(web_port, port, str(rrd)))
    return run_viewer(str(rrd))


def _write_clip(folder: Path | None, html: Path | None, gif: Path | None, mp4: Path | None) -> int:
    """Write a recording as files that need no lfa; print their names. Raises Refused."""
    from lfa.deploy.view.picture.clip import clip_of
    from lfa.deploy.view.picture.film import ffmpeg_for, write_gif, write_mp4
    from lfa.deploy.view.picture.html_file import html_of

    if folder is None:
        raise Refused("--html, --gif and --mp4: need a run folder")
    if mp4 is not None:
        ffmpeg_for(mp4)
    clip = clip_of([folder])
    write_line("drawing the recording ...", sys.stderr)
    for path, write in ((html, lambda c, p: p.write_text(html_of(c), "utf-8")), (gif, write_gif), (mp4, write_mp4)):
        if path is not None:
            with whole_file(path) as fresh:
                write(clip, fresh)
            print_visible(path)
    return 0


def converted(folder: Path) -> Path:
    """Return the path of a run's recording for the viewer, converted when older than the recording or than this code.

    Raises Refused. What an earlier version converted is removed then.
    """
    import rerun as rr

    from lfa.deploy.recording.mcap_reader import look_into, messages
    from lfa.deploy.recording.run_folder import scenario_of
    from lfa.deploy.version import code_digits
    from lfa.deploy.view.rerun.layout import layout
    from lfa.deploy.view.rerun.scene import APPLICATION, TOPICS, Scene

    rrd = folder / RRD.format(code_digits())
    look_into(folder)
    if rrd.is_file() and rrd.stat().st_mtime > max(path.stat().st_mtime for path in parts(folder)):
        return rrd
    scenario = scenario_of(folder)
    write_line("converting the recording for the viewer ...", sys.stderr)
    shown_at = time.perf_counter() + SHOW_EVERY_S
    stream = rr.RecordingStream(APPLICATION, recording_id=folder.resolve().name)
    unfinished = rrd.with_suffix(".part")
    stream.save(unfinished)
    try:
        scene = Scene(stream)
        scene.ground(scenario.world)
        scene.mission(scenario.mission)
        lasted_s = 0.0
        for owner, topic, lasted_s, message in messages(folder, TOPICS):
            scene.see(lasted_s, owner, topic, message)
            if time.perf_counter() > shown_at:
                shown_at = time.perf_counter() + SHOW_EVERY_S
                write_line(f"{lasted_s:7.1f} s of the run converted", sys.stderr)
        scene.flush()
        robots = len(scenario.mission.robots)
        layout(scenario, robots, lasted_s=lasted_s).save(APPLICATION, rrd.with_suffix(LAYOUT_AT_END))
        stream.send_blueprint(layout(scenario, robots, lasted_s=lasted_s, plays=True))
        stream.disconnect()
        _remove_earlier(rrd)
        return unfinished.rename(rrd)
    finally:
        unfinished.unlink(missing_ok=True)  # left over when the recording was refused midway


def _remove_earlier(rrd: Path) -> None:
    """Remove the recordings and layouts for the viewer that other versions left beside `rrd`."""
    for path in rrd.parent.glob("recording.*"):
        if path.suffix in (rrd.suffix, LAYOUT_AT_END) and path.stem != rrd.stem:
            path.unlink(missing_ok=True)


def _live(fleet: FleetAddress, serve_web: bool, screenshot: Path | None, port: int, web_port: int) -> int:
    """Draw a running fleet until Ctrl-C; viewers may connect and disconnect."""
    import rerun as rr

    from lfa.deploy.view.rerun.layout import layout
    from lfa.deploy.view.rerun.scene import APPLICATION

    scenario = scenario_of_fleet(fleet)
    stream = rr.RecordingStream(APPLICATION)
    plan = layout(scenario, len(fleet.team) or 4)
    if screenshot is not None:
        from lfa.deploy.view.rerun.screenshot import take

        with tempfile.TemporaryDirectory() as place:
            rrd = Path(place) / RRD.format("live")
            stream.save(rrd, default_blueprint=plan)
            _draw(fleet, stream, scenario, clock.now() + SHOT_S)
            stream.disconnect()
            print_visible(take(rrd, screenshot, None))
        return 0
    if serve_web:
        child = serve(web_port, port)
        try:
            stream.connect_grpc(data_address(port), default_blueprint=plan)
            _draw(fleet, stream, scenario, None)
        finally:
            end(child)
    elif has_display():
        rr.spawn(port=port, connect=False)
        stream.connect_grpc(data_address(port), default_blueprint=plan)
        _draw(fleet, stream, scenario, None)
    else:
        raise Refused("no display here: say --serve-web, or --screenshot FILE")
    return 0


def _draw(fleet: FleetAddress, stream: rerun.RecordingStream, scenario: Scenario | None, until: float | None) -> None:
    from lfa.deploy.view.rerun.scene import TOPICS, Scene

    scene, time, lost = Scene(stream), WorldTime(), 0
    if scenario is not None:
        scene.ground(scenario.world)
        scene.mission(scenario.mission)
    with listen(fleet, frozenset(f"*/{topic}" for topic in TOPICS), every=True) as subscriber:
        send(subscriber.bus, Operator(fleet.name, incarnations.drawn()).ask("mission", clock.now()))
        while until is None or clock.now() < until:
            clock.sleep(FLUSH_S)
            for arrival, message in subscriber.take():
                if isinstance(message, Truth):
                    time.see(arrival.at, message.time_s)
                where = address(arrival.key)
                if where is not None:
                    scene.see(time.of(arrival.at), where.owner, where.topic, message)
            scene.flush()
            if subscriber.dropped > lost:
                lost = subscriber.dropped
                print_visible(
                    f"{lost} messages lost: this machine is too busy to draw them", file=sys.stderr, flush=True
                )
