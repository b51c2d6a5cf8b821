"""`python -m lfa.deploy.fleet.host.host check|start|stop|listen|rekey`: executed on each machine by `lfa` commands.

Reads a HostPlan (JSON) from standard input and prints one JSON object after ANSWER. An error is one line on standard
error, with exit code 2 if the request is refused.
"""

from __future__ import annotations

import lfa.protocol.program_start.installed_first  # noqa: F401 (before any other module)

# isort: split
import contextlib
import os
import shutil
import signal
import socket
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import msgspec
from msgspec import Struct

from lfa.deploy.fleet.host.end import STOP_S, end, engine_of, print_answer, refuse_left, wait_gone
from lfa.deploy.fleet.host.ledger import GUARDIAN, Ledger, end_orphans, living, sweep
from lfa.deploy.fleet.host.router import LISTENS
from lfa.deploy.fleet.host.start_check import POLL_S, Found, check, check_place, family
from lfa.deploy.fleet.host.units_host import start_units, stop_units
from lfa.deploy.fleet.plan import host_plan
from lfa.deploy.fleet.plan.host_plan import HostPlan
from lfa.deploy.fleet.security.private_files import unpack
from lfa.deploy.process.identity import send_signal
from lfa.deploy.process.process_group import ROUTER_NAME
from lfa.deploy.recording.run_folder import LOGS, SCENARIO
from lfa.protocol import clock
from lfa.protocol.errors import Refused
from lfa.protocol.topics import HOST_PREFIX
from lfa.protocol.transport.zenoh_config import answers

READY_S = 15.0
LISTEN_S = 4.0
LOG = "supervisor.log"
SYSTEMD = Path("/run/systemd/system")


def start(part: HostPlan) -> Found:
    """Start this machine's supervisor so that it outlives the calling session; wait for its router. Raises Refused."""
    found = check(part)
    if found.run:
        return found
    orphans = end_orphans(part.folder)
    try:
        part.folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        check_place(part)  # as it is now: somebody may have been faster
        part.run_folder.mkdir(exist_ok=True, mode=0o700)
        (part.run_folder / SCENARIO).write_text(part.scenario, encoding="utf-8")
        path = part.folder / host_plan.PART
        if part.keyed:
            unpack(part.folder / host_plan.KEYS, part.bundle)
        path.write_bytes(msgspec.json.encode(msgspec.structs.replace(part, bundle={})))
    except OSError as error:
        raise Refused(f"{part.folder}: {error.strerror}: must be a folder to write to") from None
    log = part.run_folder / LOG
    log.touch(mode=0o600)
    note = "" if part.engine == "own" else start_units(part)
    child = _spawn(part, path, log) if part.engine == "own" else None
    _await_ready(part, child, log)
    return msgspec.structs.replace(found, run=part.run, digest=part.digest, orphans=tuple(orphans), note=note)


def stop(part: HostPlan) -> Found:
    """End this machine's watchers and processes, by SIGKILL after STOP_S. Raises Refused when a process remains."""
    if engine_of(part.folder) != "own":
        return _stop_units(part, living(part.folder))
    ended = end(part.folder)
    run, digest = ("", "") if ended is None else (ended.run, ended.digest)
    return Found(version("lfa"), clock.wall_ms(), run=run, digest=digest)


def _stop_units(part: HostPlan, running: Ledger | None) -> Found:
    """End a machine's units, and what a systemd that fails left. Raises Refused when a process remains."""
    stop_units(part)
    refuse_left(wait_gone(() if running is None else (running.supervisor, *running.children), STOP_S))
    sweep(part.folder)
    run, digest = ("", "") if running is None else (running.run, running.digest)
    return Found(version("lfa"), clock.wall_ms(), run=run, digest=digest)


def _spawn(part: HostPlan, path: Path, log: Path) -> subprocess.Popen[bytes]:
    """Start the guardian, which starts the supervisor, under systemd if that is running here, else in a session."""
    command = [sys.executable, "-P", "-m", GUARDIAN, str(path)]
    with log.open("ab") as out:
        for runner in _runners(part):
            asked = subprocess.run([*runner, *command], stdout=out, stderr=out, stdin=subprocess.DEVNULL, check=False)
            if asked.returncode == 0:
                return subprocess.Popen(["true"])
        return subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=out, stderr=out, start_new_session=True)


def _runners(part: HostPlan) -> list[list[str]]:
    """Return the systemd-run command, with restart on failure: a system unit for root, else a user unit."""
    if not SYSTEMD.is_dir() or shutil.which("systemd-run") is None:
        return []
    unit = ["--unit", f"lfa-{part.fleet}-{part.host}", "--collect", "--property", "Restart=on-failure"]
    log = ["--property", f"StandardOutput=append:{part.run_folder / LOG}", "--property", "KillMode=process"]
    return [["systemd-run", *([] if os.getuid() == 0 else ["--user"]), "--quiet", *unit, *log]]


def _await_ready(part: HostPlan, child: subprocess.Popen[bytes] | None, log: Path) -> None:
    """Wait until the supervisor is running and its router answers. Raises Refused after READY_S."""
    known = part.known_as(f"{HOST_PREFIX}{part.host}")
    until = clock.now() + READY_S
    while not (living(part.folder) is not None and answers(part.socket, known)):
        code = None if child is None else child.poll()
        if code not in (None, 0) or clock.now() > until:
            if child is not None:
                child.kill()
                child.wait()
            stop(part)
            lines = log.read_text(errors="replace").strip().splitlines()
            raise Refused(f"its supervisor is not ready: {lines[-1] if lines else f'see {log}'}")
        clock.sleep(POLL_S)


def listen(part: HostPlan) -> Found:
    """Listen at the router's port until a connection arrives or LISTEN_S is over, to test whether the port is open."""
    if part.over_udp:
        _echo(part)
        return Found(version("lfa"), clock.wall_ms())
    with socket.create_server(("", part.port), family=family(part)) as server:
        server.settimeout(LISTEN_S)
        with contextlib.suppress(TimeoutError):
            server.accept()[0].close()
    return Found(version("lfa"), clock.wall_ms())


def _echo(part: HostPlan) -> None:
    with socket.socket(family(part), socket.SOCK_DGRAM) as server:
        server.bind(("", part.port))
        server.settimeout(LISTEN_S)
        with contextlib.suppress(TimeoutError):
            knock, who = server.recvfrom(64)
            server.sendto(knock, who)


def rekey(part: HostPlan) -> Found:
    """Install new keys and rules on a running machine and restart its router with them. Raises Refused."""
    running = living(part.folder)
    if running is None or not (own := host_plan.read(part.folder / host_plan.PART)).keyed:
        return Found(version("lfa"), clock.wall_ms())
    unpack(part.folder / host_plan.KEYS, part.bundle)
    log = own.run_folder / LOGS / f"{ROUTER_NAME}.log"
    before = log.read_text(errors="replace").count(LISTENS)
    for router in (child for child in running.children if "lfa.deploy.fleet.host.router" in child.arguments):
        send_signal(router, signal.SIGHUP)
    until = clock.now() + READY_S
    while log.read_text(errors="replace").count(LISTENS) == before:
        if clock.now() > until:
            raise Refused(f"its router does not open anew: see {log}")
        clock.sleep(POLL_S)
    return Found(version("lfa"), clock.wall_ms(), running.run, running.digest)


ANSWERS_TO = {"check": check, "start": start, "stop": stop, "listen": listen, "rekey": rekey}


def _answer(given: bytes) -> Struct:
    return ANSWERS_TO[sys.argv[1]](msgspec.json.decode(given, type=HostPlan))


if __name__ == "__main__":
    print_answer(_answer)
