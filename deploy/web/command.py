"""`lfa web`: one page in a browser, on a team in virtual time, a running fleet, or a recording."""

from __future__ import annotations

import secrets
import ssl
import sys
from contextlib import suppress
from pathlib import Path
from typing import Annotated

import msgspec
import typer
from msgspec.structs import replace

from lfa.deploy.client.session import find
from lfa.deploy.fleet.host.router import host_credentials
from lfa.deploy.process.coroutines import run_to_end
from lfa.deploy.run.machine_size import FEW_BEAMS, SLOW_HZ
from lfa.deploy.scenario_loading import load_scenario
from lfa.deploy.terminal_text import print_visible
from lfa.deploy.view.picture.clip import clip_of
from lfa.deploy.web.engine import Engine, RecordingEngine
from lfa.deploy.web.fleet import FleetEngine
from lfa.deploy.web.lessons import LESSONS
from lfa.deploy.web.server import PageServer, PageTokens, is_loopback
from lfa.deploy.web.share import Setting, setting_of
from lfa.deploy.web.virtual import VirtualEngine
from lfa.protocol.errors import Refused
from lfa.protocol.output import write_line

PORT = 8642
HOST = "127.0.0.1"
ROBOTS_USUAL = 16
"""Number of robots above which a team in virtual time is computed at the rates of `LIGHT`."""
LIGHT: dict[str, float] = {"mission.control_hz": SLOW_HZ, "world.lidar.beams": FEW_BEAMS}


def command(
    what: Annotated[
        list[str] | None,
        typer.Argument(metavar="[SCENARIO | LINK | RUN [RUN]]", help="Default: the lesson of the killed leader."),
    ] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of noise, places and losses; default the scenario's.")] = None,
    robots: Annotated[int | None, typer.Option(help="Number of robots, instead of the scenario's.")] = None,
    overrides: Annotated[list[str] | None, typer.Option("--set", help="Override a field of the scenario.")] = None,
    port: Annotated[int, typer.Option(help="Port of the page; 0: any free one.")] = PORT,
    live: Annotated[bool, typer.Option("--live", help="Show the fleet that runs here.")] = False,
    fleet: Annotated[str | None, typer.Option(help="Show this running fleet.")] = None,
    connect: Annotated[str | None, typer.Option(help="Router of that fleet, if not its own here.")] = None,
    listen: Annotated[str, typer.Option(help="Address to listen on; one for others needs --keys.")] = HOST,
    keys: Annotated[Path | None, typer.Option(help="Keys of this machine, from lfa keys.")] = None,
) -> int:
    """Serve the page until Ctrl-C. Raises Refused."""
    if not 0 <= port <= 65535:
        raise Refused(f"--port {port}: must be from 0 to 65535")
    secure = _secured(listen, keys)
    if live or fleet is not None or connect is not None:
        if what or seed is not None or robots is not None or overrides:
            raise Refused("--live, --fleet, --connect: show a fleet as it runs, give no scenario with them")
        return serve_engine(FleetEngine(find(fleet, connect, keys)), listen, port, secure)
    runs = [Path(name) for name in what or () if Path(name).is_dir()]
    if runs:
        if len(runs) < len(what or ()) or seed is not None or robots is not None or overrides:
            raise Refused("a run is shown as it was: give run folders only, one or two")
        clip = msgspec.json.encode(clip_of(runs))
        return serve_engine(RecordingEngine(), listen, port, secure, clip)
    if len(what or ()) > 1:
        raise Refused(f"{' '.join(what or ())}: must be one scenario, or one or two run folders")
    engine = _virtual(what[0] if what else None, seed, robots, tuple(overrides or ()))
    return serve_engine(engine, listen, port, secure)


def serve_engine(engine: Engine, listen: str, port: int, secure: ssl.SSLContext | None, clip: bytes = b"") -> int:
    """Print the addresses of the page and serve it until Ctrl-C."""
    tokens = PageTokens(secrets.token_urlsafe(18), secrets.token_urlsafe(18))

    def ready() -> None:
        base = f"http{'s' if secure else ''}://{f'[{listen}]' if ':' in listen else listen}:{server.port}/"
        print_visible(f"to operate: {base}?token={tokens.operator}")
        print_visible(f"to look:    {base}?token={tokens.viewer}", flush=True)

    server = PageServer(engine, tokens, clip)
    try:
        with suppress(KeyboardInterrupt):
            run_to_end(server.run(listen, port, secure, ready))
    finally:
        engine.close()
    return 0


def _virtual(what: str | None, seed: int | None, robots: int | None, overrides: tuple[str, ...]) -> Engine:
    """Return the engine of a scenario, of a link, or of the first lesson. Raises Refused."""
    if what is None and seed is None and robots is None and not overrides:
        lesson = LESSONS[0]
        return VirtualEngine(lesson.setting, lesson)
    if what is not None and "#" in what:
        setting = setting_of(what)
    else:
        setting = lighter(Setting(what or LESSONS[0].setting.scenario, seed, robots, overrides))
    return VirtualEngine(setting, allowed=setting.scenario)


def lighter(setting: Setting) -> Setting:
    """Return a setting with lower rates if it has many robots, and say so in a line. Raises Refused.

    Rates that it sets stay. The others become part of the run, its link and the saved scenario: it is the same run on
    every machine.
    """
    scenario = load_scenario(setting.scenario, setting.overrides, setting.robots)
    kept = {override.partition("=")[0].strip() for override in setting.overrides}
    usual = {"mission.control_hz": scenario.mission.control_hz, "world.lidar.beams": scenario.world.lidar.beams}
    rates = tuple(f"{key}={value:g}" for key, value in LIGHT.items() if key not in kept and value < usual[key])
    robots = len(scenario.mission.robots)
    if robots <= ROBOTS_USUAL or not rates:
        return setting
    write_line(f"{robots} robots: computed with {', '.join(rates)} (--set another value keeps that)", sys.stderr)
    return replace(setting, overrides=(*setting.overrides, *rates))


def _secured(listen: str, keys: Path | None) -> ssl.SSLContext | None:
    """Return the TLS context of this machine in the fleet; None on this machine's own addresses. Raises Refused."""
    if is_loopback(listen):
        return None
    if keys is None:
        raise Refused(f"--listen {listen}: must come with --keys, so that nobody reads the token on its way")
    known = host_credentials(keys)
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = ssl.TLSVersion.TLSv1_3
    context.load_cert_chain(known.certificate, known.key)
    return context
