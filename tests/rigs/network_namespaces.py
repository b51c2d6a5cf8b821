"""Several hosts on one machine: network namespaces on a bridge, each with its own router, connected by tcp links.

Requires root, ip and nft. Names contain the process id, so that parallel runs do not collide; everything is removed at
the end of the block.
"""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from lfa.deploy.bench.harness.team import Team, endless
from lfa.deploy.process.process_group import ROUTER_NAME, ProcessSpec
from lfa.protocol.names import robot_id_of
from lfa.protocol.topics import RECORDER_NAME, WORLD_NAME

PORT = 7447
ROBOTS = 4
WORLD_HOST = 0
"""Number of the host of world and witness; robot n is on host n."""
TABLE = "inet lfa"


def missing() -> str | None:
    """Return the reason why such a network is impossible here, or None if it is possible."""
    if os.geteuid() != 0:
        return "needs root, for network namespaces"
    absent = [tool for tool in ("ip", "nft") if shutil.which(tool) is None]
    if absent:
        return f"needs {' and '.join(absent)}"
    probe = f"lfa{os.getpid()}p"
    made = subprocess.run(["ip", "netns", "add", probe], capture_output=True, text=True, check=False)
    if made.returncode != 0:
        return f"no network namespaces here: {made.stderr.strip()}"
    _run("ip", "netns", "del", probe)
    return None


class Net:
    """Hosts 0..N, all on one switch."""

    def __init__(self, hosts: int) -> None:
        self._switch = f"lfa{os.getpid()}s"
        self._made: list[str] = []
        self.hosts = range(hosts)

    def __enter__(self) -> Net:
        try:
            self._namespace(self._switch)
            self._inside(self._switch, "ip", "link", "add", "br0", "type", "bridge")
            self._inside(self._switch, "ip", "link", "set", "br0", "up")
            for host in self.hosts:
                self._join(host)
        except BaseException:
            self._end()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self._end()

    def _end(self) -> None:
        while self._made:
            _run("ip", "netns", "del", self._made.pop())

    def _namespace(self, name: str) -> None:
        _run("ip", "netns", "add", name)
        self._made.append(name)
        self._inside(name, "ip", "link", "set", "lo", "up")

    def _join(self, host: int) -> None:
        name, port = _name(host), f"p{host}"
        self._namespace(name)
        peer = ("peer", "name", port, "netns", self._switch)
        self._inside(name, "ip", "link", "add", "eth0", "type", "veth", *peer)
        self._inside(name, "ip", "addr", "add", f"{_ip(host)}/24", "dev", "eth0")
        self._inside(name, "ip", "-6", "addr", "add", f"{self.address6(host)}/64", "dev", "eth0", "nodad")
        self._inside(name, "ip", "link", "set", "eth0", "up")
        self._inside(self._switch, "ip", "link", "set", port, "master", "br0", "up")

    def enter(self, host: int) -> tuple[str, ...]:
        """Return the command prefix that runs a command on that host."""
        return _enter(host)

    def address(self, host: int) -> str:
        return _ip(host)

    def address6(self, host: int) -> str:
        return f"fd00:77::{host + 1}"

    def unplug(self, host: int) -> None:
        """Take the host's link down: no packet passes, and no process is notified."""
        self._inside(self._switch, "ip", "link", "set", f"p{host}", "down")

    def plug_in(self, host: int) -> None:
        self._inside(self._switch, "ip", "link", "set", f"p{host}", "up")

    def _inside(self, name: str, *command: str) -> None:
        _run("ip", "netns", "exec", name, *command)

    # --- faults ----------------------------------------------------------------------------------------------------

    def cut(self, one: Sequence[int], other: Sequence[int]) -> None:
        """Drop all packets between the sides at their receivers, as the link model does."""
        for side, far in ((one, other), (other, one)):
            for host in side:
                self._rules(host, f"ip saddr {{ {', '.join(_ip(f) for f in far)} }} drop")

    def reset(self, host: int) -> None:
        """Reset every tcp link of that host with its next packet, until `heal`."""
        self._rules(host, "ip saddr != 127.0.0.1 meta l4proto tcp reject with tcp reset")

    def lose(self, percent: int) -> None:
        """Drop `percent` of all packets between hosts; on tcp links the effect is delay."""
        for host in self.hosts:
            self._rules(host, f"ip saddr != 127.0.0.1 numgen random mod 100 < {percent} drop")

    def close_port(self, host: int, port: int) -> None:
        """Drop all packets to a port of the host without an answer, as a firewall does."""
        self._rules(host, f"meta l4proto {{ tcp, udp }} th dport {port} drop")

    def heal(self) -> None:
        for host in self.hosts:
            self._inside(_name(host), "nft", f"add table {TABLE}; delete table {TABLE}")

    def _rules(self, host: int, rule: str) -> None:
        chain = f"chain {TABLE} in {{ type filter hook input priority 0; }}"
        script = f"add table {TABLE}; delete table {TABLE}; add table {TABLE}; add {chain}; add rule {TABLE} in {rule}"
        self._inside(_name(host), "nft", script)


@contextmanager
def team_on_hosts() -> Iterator[tuple[Team, Net]]:
    """Start four robots, each on its own host, and the world on another."""
    with Net(ROBOTS + 1) as net, Team(endless(ROBOTS), table_on_hosts) as team:
        yield team, net


def table_on_hosts(usual: Sequence[ProcessSpec], sockets: Path, robots: int = ROBOTS) -> list[ProcessSpec]:
    """Return one router per host and the processes of each host.

    The observer session uses the unix socket of the world's router.
    """
    rows = [_router(host, sockets) for host in range(robots + 1)]
    for row in usual:
        host = WORLD_HOST if row.name == WORLD_NAME else robot_id_of(row.name)
        if row.name not in (ROUTER_NAME, RECORDER_NAME) and host is not None:
            told = tuple(
                host_socket(host, sockets) if word == host_socket(WORLD_HOST, sockets) else word
                for word in row.arguments
            )
            rows.append(ProcessSpec(row.name, told, restart_args=row.restart_args, command_prefix=_enter(host)))
    return rows


def _router(host: int, sockets: Path) -> ProcessSpec:
    listen = ("--listen", host_socket(host, sockets), "--listen", f"tcp/{_ip(host)}:{PORT}")
    others = (word for far in range(host) for word in ("--connect", f"tcp/{_ip(far)}:{PORT}"))
    name = ROUTER_NAME if host == WORLD_HOST else f"{ROUTER_NAME}{host}"
    return ProcessSpec(name, ("lfa.deploy.fleet.host.router", *listen, *others), command_prefix=_enter(host))


def host_socket(host: int, sockets: Path) -> str:
    """Return the endpoint of a host's router for processes of that host."""
    return f"unixsock-stream/{sockets / ('router.sock' if host == WORLD_HOST else f'router{host}.sock')}"


def _enter(host: int) -> tuple[str, ...]:
    ip = shutil.which("ip")
    assert ip is not None
    return (ip, "netns", "exec", _name(host))


def _name(host: int) -> str:
    return f"lfa{os.getpid()}h{host}"


def _ip(host: int) -> str:
    return f"10.77.0.{host + 1}"


def _run(*command: str) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise OSError(f"{' '.join(command)}: {done.stderr.strip()}")
