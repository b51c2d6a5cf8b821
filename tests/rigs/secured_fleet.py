"""Fleet behind a secured router, and an attacker with Zenoh sessions and a choice of certificate and password."""

from __future__ import annotations

import json
import shutil
import socket
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import zenoh

from lfa.deploy.bench.harness.team import Team, endless
from lfa.deploy.fleet.security import authority, keys, registry
from lfa.deploy.process.process_group import ROUTER_NAME, ProcessSpec
from lfa.protocol import clock
from lfa.protocol.messages.codec import decode, encode
from lfa.protocol.messages.consensus import Fence, LeaseNote, Prepare, Propose, Release, Term, Version
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.team import Status
from lfa.protocol.topics import RECORDER_NAME
from lfa.protocol.transport.credentials import Credentials, credentials
from tests.rigs.lfa_runs import eventually

FLEET, ROBOTS = "secured", 3
WHOLE_S = 20.0
TRAITOR = "robot3"
"""Robot whose keys the attacker has; the last of the chain."""
BASE = f"lfa/{FLEET}"
REVOKED, ELSEWHERE = "robot4", "robot5"
"""Members without a process: one revoked, one assigned to machine `b`."""


class Attacked:
    """Fleet under attack: its team, the folders of keys, and the endpoints of its router."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.unix = ""
        self.port = free_port()
        self.tls = f"tls/127.0.0.1:{self.port}"
        self.keys = folder / "keys"
        places = {f"robot{n}": ["a"] for n in range(1, 5)} | {ELSEWHERE: ["b"], "world": ["a"]}
        keys.make(self.keys, keys.spread(FLEET, {"a": (), "b": ()}, range(1, 6), places))
        shutil.copytree(self.keys / "issued", folder / "stolen")
        keys.revoke(self.keys, [REVOKED])
        self.home = registry.folder_of(self.keys, "a")
        self.team = Team(endless(ROBOTS), self._table, self._credentials(RECORDER_NAME), FLEET)

    def _credentials(self, name: str) -> Credentials:
        return credentials(self.home, name, clock.wall_ms())

    def _table(self, usual: Sequence[ProcessSpec], sockets: Path) -> list[ProcessSpec]:
        """Return the processes: robot 2 connects over tls with its certificate, all others over the unix socket."""
        self.unix = usual[0].arguments[-1]
        listen = ("lfa.deploy.fleet.host.router", "--listen", self.unix, "--listen", self.tls, *self._keys(True))
        rows = [ProcessSpec(ROUTER_NAME, listen)]
        for row in usual:
            if row.name not in (ROUTER_NAME, RECORDER_NAME):
                endpoint = self.tls if row.name == "robot2" else self.unix
                told = (endpoint if word.startswith("unixsock") else word for word in row.arguments)
                rows.append(ProcessSpec(row.name, (*told, *self._keys(False)), restart_args=row.restart_args))
        return rows

    def _keys(self, secure: bool) -> tuple[str, ...]:
        return ("--keys", str(self.home)) + (("--secure",) if secure else ())

    def drives_on(self) -> None:
        """Wait until all robots are in one chain whose first robot leads, and all publish poses."""
        self.team.wait_until(lambda: self.team.chain() == (1, 2, 3), "the fleet does not drive on", WHOLE_S)

    # --- sessions of the attacker -----------------------------------------------------------------------------------

    def open(self, endpoint: str, name: str | None = TRAITOR, folder: Path | None = None, **more: Any) -> zenoh.Session:
        """Open a session with the certificate and password of `name` from `folder`, by default the stolen ones."""
        config: dict[str, Any] = {
            "mode": "client",
            "connect/endpoints": [endpoint],
            "scouting/multicast/enabled": False,
            "transport/link/tx/lease": 1000,
        }
        if name is not None:
            at = folder or self.folder / "stolen"
            user, _, password = (at / f"{name}.password").read_text().strip().partition(":")
            config["transport/auth/usrpwd"] = {"user": user, "password": password}
            config["transport/link/tls"] = tls(at.parent / "keys" / "ca.pem", at / name)
        parsed = zenoh.Config()
        for key, value in (config | more).items():
            parsed.insert_json5(key, json.dumps(value))
        return zenoh.open(parsed)

    def refused(self, endpoint: str, name: str | None = TRAITOR, folder: Path | None = None, **more: Any) -> bool:
        """Return True if the router refuses the session."""
        try:
            self.open(endpoint, name, folder, **more).close()  # type: ignore[no-untyped-call]
        except zenoh.ZError:
            return True
        return False

    def passes(self, attack: Callable[[zenoh.Session], object], listen: str, name: str = TRAITOR) -> bool:
        """Return True if a subscriber to `listen` receives `b"attack"`, or a deletion, after the call of `attack`.

        Afterwards the attacker publishes a permitted message until it arrives; all earlier ones would have arrived.
        Both wait for room in the link's queue: what a loaded machine drops says nothing about the router's rules.
        """
        heard: list[tuple[str, bytes, bool]] = []

        def hear(sample: zenoh.Sample) -> None:
            deleted = sample.kind == zenoh.SampleKind.DELETE
            heard.append((str(sample.key_expr), sample.payload.to_bytes(), deleted))

        with self.open(self.unix, RECORDER_NAME) as onlooker, self.open(self.unix, name) as attacker:
            onlooker.declare_subscriber(f"lfa/{FLEET}/{listen}", hear)
            onlooker.declare_subscriber(f"lfa/{FLEET}/{name}/event", hear)
            block = zenoh.CongestionControl.BLOCK
            own = attacker.declare_publisher(f"lfa/{FLEET}/{name}/event", congestion_control=block)
            until = clock.now() + WHOLE_S
            while not own.matching_status.matching:  # type: ignore[attr-defined]
                assert clock.now() < until, "the router did not tell the attacker of the onlooker"
                clock.sleep(0.005)
            attack(attacker)
            until = clock.now() + WHOLE_S
            while not any(payload == b"done" for _, payload, _ in heard):
                assert clock.now() < until, "what the attacker may say does not come either"
                own.put(b"done")  # again and again: a router that just learned of the onlooker may drop the first
                clock.sleep(0.05)
        return any(payload[:6] == b"attack" or deleted for _, payload, deleted in heard)


class Poison:
    """Messages with terms of the attacker's choice, in the name of robot 3, whose keys it has."""

    def __init__(self, attacker: zenoh.Session) -> None:
        """Listen until the leader, robot 1, has said what the team agrees on."""
        self.proposes: list[Propose] = []
        """What robot 1 proposed so far."""
        self._attacker = attacker
        self._statuses: list[Status] = []
        attacker.declare_subscriber(f"{BASE}/*/lease/all", self._hear_lease)
        attacker.declare_subscriber(f"{BASE}/{TRAITOR}/status", self._hear_status)
        eventually(lambda: bool(self.proposes) and bool(self._statuses), "robot 1 or robot 3 says nothing")
        self.agreed = self.proposes[-1].agreed

    def say(self, number: int) -> None:
        """Say a term with this number to all voters and gateways."""
        mine = self._statuses[-1].header.incarnation
        term, agreed = Term(number, 3, mine), self.agreed
        said = (Prepare(term, Version(), agreed=agreed), Prepare(term, Version(term), agreed=agreed), Release(term))
        orders = {f"gateway{robot}": (Fence(term, term),) for robot in range(1, ROBOTS + 1)}
        for to, bodies in ({"all": said} | orders).items():
            for body in bodies:
                note = LeaseNote(Header(TRAITOR, mine, 0, 0.0), body)
                self._attacker.put(f"{BASE}/{TRAITOR}/lease/{to}", encode(note))
                clock.sleep(0.01)  # in one batch they are a flood to the router

    def _hear_lease(self, sample: zenoh.Sample) -> None:
        note = decode(sample.payload.to_bytes(), LeaseNote)
        if isinstance(note, LeaseNote) and note.header.sender == "robot1" and isinstance(note.body, Propose):
            self.proposes.append(note.body)

    def _hear_status(self, sample: zenoh.Sample) -> None:
        status = decode(sample.payload.to_bytes(), Status)
        assert isinstance(status, Status)
        self._statuses.append(status)


def tls(ca: Path, stem: Path) -> dict[str, Any]:
    return {
        "root_ca_certificate": str(ca),
        "enable_mtls": True,
        "connect_private_key": f"{stem}.key",
        "connect_certificate": f"{stem}.pem",
    }


def forge(folder: Path, name: str, ca_folder: Path, days: float = 1.0) -> Path:
    """Create `folder` with the password of `name` and a certificate of the authority in `ca_folder`; return it."""
    folder.mkdir()
    ca = authority.load(ca_folder / "ca.pem", ca_folder / "ca.key")
    authority.issue(folder / name, ca, name, (), days)
    shutil.copy(folder.parent / "stolen" / f"{name}.password", folder)
    return folder


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


@contextmanager
def attacked() -> Iterator[Attacked]:
    folder = Path(tempfile.mkdtemp(prefix="lfa-"))
    try:
        made = Attacked(folder)
        with made.team:
            made.team.await_chain(ROBOTS, WHOLE_S)
            yield made
    finally:
        shutil.rmtree(folder)
