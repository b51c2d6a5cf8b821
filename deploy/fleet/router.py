"""`lfa-router`: the machine's one router. Agents, world and recorder are its clients."""

from __future__ import annotations

import signal
import sys
from typing import Annotated

import typer

from deploy.cli import command_app, run_cli
from protocol.zenoh_bus import default_endpoint, open_router

DEFAULT_TCP = "tcp/127.0.0.1:7447"


def command(
    listen: Annotated[
        list[str] | None,
        typer.Option(help=f"Where to listen, again for more. Default: {default_endpoint()} and {DEFAULT_TCP}."),
    ] = None,
    connect: Annotated[
        list[str] | None, typer.Option(help="Another machine's router, such as tcp/machine-a:7447.")
    ] = None,
) -> int:
    """Run until SIGTERM or Ctrl-C."""
    ending = {signal.SIGTERM, signal.SIGINT}
    signal.pthread_sigmask(signal.SIG_BLOCK, ending)  # before Zenoh's threads, so that they inherit it
    endpoints = listen or [default_endpoint(), DEFAULT_TCP]
    close = open_router(endpoints, connect or ())
    print(f"router listens at {' '.join(endpoints)}", flush=True)
    signal.sigwait(ending)
    close()
    return 0


def main() -> None:
    help_text = "The router of this machine: agents and world meet here."
    sys.exit(run_cli("lfa-router", command_app(command, help_text, "lfa-router --listen tcp/0.0.0.0:7447")))


if __name__ == "__main__":
    main()
