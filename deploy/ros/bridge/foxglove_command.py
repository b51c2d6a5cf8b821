"""`lfa foxglove`: a running fleet live in Foxglove or Lichtblick, until Ctrl-C or SIGTERM."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Annotated

import typer

from lfa.deploy.client.session import find, listen
from lfa.deploy.process.signals import Interrupts
from lfa.deploy.ros.bridge.answers import answer
from lfa.deploy.ros.bridge.bridge import EAGER, Bridge
from lfa.deploy.ros.bridge.foxglove_output import FoxgloveOutput
from lfa.deploy.ros.bridge.inward import SERVICES, TRIGGER, ServiceInput
from lfa.deploy.terminal_text import print_visible
from lfa.protocol import clock
from lfa.protocol.errors import Refused
from lfa.protocol.transport.bus import Wake

PORT = 8765
FORMATIONS = {f"/lfa/formation/{side}": side for side in ("left", "right", "column", "zigzag")}
LAYOUT = Path(__file__).with_name("foxglove_layout.json")
"""Layout for Foxglove and Lichtblick: map, robots, slots, leader, errors and buttons."""


def command(
    fleet: Annotated[str | None, typer.Option(help="Name of the fleet, when several run here.")] = None,
    connect: Annotated[str | None, typer.Option(help="Router of the fleet; default the fleet's own here.")] = None,
    keys: Annotated[Path | None, typer.Option(help="Folder of lfa keys, for a secured fleet.")] = None,
    host: Annotated[str, typer.Option(help="Address to listen at; 0.0.0.0 for all of this machine's.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(help="Port of the WebSocket; 0 for a free one.")] = PORT,
    tf_per_robot: Annotated[
        bool, typer.Option("--tf-per-robot", help="Topics /robotN/tf with plain frames, not /tf with robotN/ frames.")
    ] = False,
    layout: Annotated[Path | None, typer.Option(help="Also write the layout to this file, and end.")] = None,
) -> int:
    """Serve a running fleet to Foxglove."""
    if layout is not None:
        return _write_layout(layout)
    if not 0 <= port <= 65535:
        raise Refused(f"--port {port}: must be 0 to 65535")
    found = find(fleet, connect, keys)
    wake = Wake()
    with Interrupts() as interrupts, listen(found, frozenset(), every=True, wake=wake, eager=EAGER) as subscriber:
        output = FoxgloveOutput(host, port, SERVICES | dict.fromkeys(FORMATIONS, TRIGGER), tf_per_robot=tf_per_robot)
        try:
            bridge = Bridge(subscriber, output, sim_time=False, tf_per_robot=tf_per_robot)
            services = ServiceInput(bridge)
            print_visible(f"fleet {found.name}: open ws://{host}:{output.port} in Foxglove or Lichtblick", flush=True)
            print_visible(f"layout: {LAYOUT}", flush=True)
            while interrupts.signal is None:
                wake.wait(bridge.period_s())
                now = clock.now()
                bridge.step(now)
                output.greet(time.time_ns())
                _obey(output, bridge, services, now)
        finally:
            output.close()
    return 0


def _obey(output: FoxgloveOutput, bridge: Bridge, services: ServiceInput, now: float) -> None:
    """Pass on the buttons that were pressed, and answer the calls that are decided."""
    while output.calls:
        name, call = output.calls.popleft()
        if name in FORMATIONS:
            bridge.order("formation", side=FORMATIONS[name])
            answer(call, success=True, text=f"asked for {FORMATIONS[name]}")
        else:
            services.obey(name, call, bridge.leader, now)
    services.step(bridge.leader, now)


def _write_layout(path: Path) -> int:
    try:
        path.write_bytes(LAYOUT.read_bytes())
    except OSError as error:
        raise Refused(f"--layout {path}: cannot be written ({error.strerror}), give a place to write to") from None
    print_visible(path, file=sys.stdout)
    return 0
