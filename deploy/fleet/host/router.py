"""`lfa-router`: the Zenoh router of a machine, one per machine. Agents, world and recorder are its clients."""

from __future__ import annotations

import lfa.protocol.program_start.installed_first  # noqa: F401 (before any other module)

# isort: split
import os
import signal
import socket
import sys
from pathlib import Path
from typing import Annotated, Literal

import typer

from lfa.deploy.command_line import command_app, run_cli
from lfa.protocol import clock
from lfa.protocol.errors import Refused
from lfa.protocol.output import write_line
from lfa.protocol.runtime.systemd import Notify
from lfa.protocol.topics import HOST_PREFIX
from lfa.protocol.transport.credentials import Credentials, credentials
from lfa.protocol.transport.zenoh_config import LINK_LEASES_MS, default_endpoint
from lfa.protocol.transport.zenoh_router import open_router

DEFAULT_TCP, DEFAULT_TLS = "tcp/127.0.0.1:7450", "tls/127.0.0.1:7450"  # 7447 is ROS 2's
LISTENS = "router listens at"
SIGN_S = 1.0
ENDING = {signal.SIGTERM, signal.SIGINT}


def command(
    listen: Annotated[
        list[str] | None,
        typer.Option(
            help=f"Endpoint to listen at; repeatable. Default: {default_endpoint()} and, if it is free, {DEFAULT_TCP}"
            f" ({DEFAULT_TLS} with --secure)."
        ),
    ] = None,
    connect: Annotated[
        list[str] | None,
        typer.Option(help="Endpoint of another machine's router, such as quic/machine-a:7447; repeatable."),
    ] = None,
    keys: Annotated[
        Path | None,
        typer.Option(help="This machine's folder of `lfa keys`: enables tls/ and quic/, for its fleet only."),
    ] = None,
    secure: Annotated[
        bool, typer.Option("--secure", help="Pass only what the rules in --keys allow; deny the rest.")
    ] = False,
    link: Annotated[
        Literal["fast", "std", "wifi", "auto"],
        typer.Option(help="Profile: a silent link counts as dead after 0.5, 1, 2 or 2 s."),
    ] = "std",
) -> int:
    """Run the router until SIGTERM or Ctrl-C; SIGHUP restarts it with the current keys and rules."""
    if secure and keys is None:
        raise Refused("--secure: needs --keys, a folder that lfa keys init made (DIR/hosts/NAME)")
    signal.pthread_sigmask(signal.SIG_BLOCK, ENDING | {signal.SIGHUP})  # before Zenoh starts threads, which inherit it
    endpoints = listen or default_endpoints(DEFAULT_TLS if secure else DEFAULT_TCP)
    close = open_router(endpoints, connect or (), LINK_LEASES_MS[link], _known(keys), secure)
    write_line(f"{LISTENS} {' '.join(endpoints)}{', secure' if secure else ''}: ready", sys.stdout)
    notify = Notify(os.environ.get("NOTIFY_SOCKET", ""))
    notify.ready()
    while (came := _signal_within(SIGN_S)) not in ENDING:
        notify.alive()
        if came is None:
            continue
        try:
            _known(keys)
        except Refused as refused:
            write_line(f"goes on as it was: {refused}", sys.stderr)
            continue
        close()
        os.execv(sys.executable, sys.orig_argv)  # frees the QUIC port, which a closed session keeps
    close()
    assert came is not None
    by_hand = came == signal.SIGINT
    write_line(f"router ended, by {'Ctrl-C' if by_hand else came.name}", sys.stdout)
    return 130 if by_hand else 0


def default_endpoints(shared: str) -> list[str]:
    """Return where a router without `--listen` listens: at this user's socket and, if it is free, at `shared`.

    The port of `shared` is one for all users of a machine: a router of another user does not stop this one.
    """
    host, _, port = shared.partition("/")[2].rpartition(":")
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, int(port)))
        except OSError:
            write_line(f"{shared} is taken, as by another user's router: goes on without it", sys.stderr)
            return [default_endpoint()]
    return [default_endpoint(), shared]


def _signal_within(timeout_s: float) -> signal.Signals | None:
    """Wait for a signal that ends or restarts the router; return None after `timeout_s` [s] without one."""
    came = signal.sigtimedwait(ENDING | {signal.SIGHUP}, timeout_s)
    return None if came is None else signal.Signals(came.si_signo)


def _known(keys: Path | None) -> Credentials | None:
    return None if keys is None else host_credentials(keys)


def host_credentials(folder: Path) -> Credentials:
    """Return the credentials of the machine that `folder` belongs to. Raises Refused unless it holds exactly one."""
    names = [path.stem for path in folder.glob(f"{HOST_PREFIX}*.pem")]
    if len(names) != 1:
        raise Refused(f"{folder}: must hold one machine's keys ({HOST_PREFIX}NAME.pem), like DIR/hosts/NAME")
    return credentials(folder, names[0], clock.wall_ms())


def main() -> None:
    help_text = "Run the Zenoh router of this machine, which agents and world connect to."
    example = "lfa-router --keys keys/hosts/a --listen unixsock-stream//run/lfa/z.sock --listen quic/0.0.0.0:7447"
    sys.exit(run_cli("lfa-router", command_app(command, help_text, example)))


if __name__ == "__main__":
    main()
