"""Simulated machines with ssh access: network namespaces, each with its own sshd; one temporary key and operator home.

The hosts share this machine's file system; each has its own state folder, named in the fleet file.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

from lfa.deploy.fleet.plan import host_plan
from lfa.deploy.fleet.plan.host_plan import HostPlan
from lfa.deploy.process import identity
from lfa.deploy.process.identity import Identity
from lfa.protocol import clock
from tests.rigs.network_namespaces import Net, missing

OPERATOR = 0
"""Number of the host on which `lfa up` runs; machine n of the fleet is host n."""
NAMES = "abcdefgh"
KEPT = "lfa-failed-hosts-"
"""Prefix of the folder in which a failed test leaves the journals and logs of its machines."""
SSHD = "/usr/sbin/sshd"
ALONE = ("unshare", "--pid", "--fork", "--kill-child", "--mount-proc")
"""Start of a command that sees no processes but its own."""
LFA = (sys.executable, "-c", "from lfa.deploy.cli import main; main()")


def why_not() -> str | None:
    """Return the reason why such machines are impossible here, or None if they are possible."""
    if shutil.which("ssh-keygen") is None or not Path(SSHD).exists():
        return "needs openssh-server"
    return missing()


class Machines:
    """Hosts `a`, `b`, ... and the operator's host, all on one switch."""

    def __init__(self, net: Net, folder: Path, count: int, *, six: bool, shells: Mapping[str, str]) -> None:
        self.net = net
        self._six = six
        self._shells = shells
        self.folder = folder
        self.names = NAMES[:count]
        self.home = folder / "home"
        self.fleet_file = folder / "convoy.toml"
        self._servers: dict[str, subprocess.Popen[bytes]] = {}
        self._known: set[Identity] = set()

    # --- set-up and removal ----------------------------------------------------------------------------------------

    def open(self) -> None:
        ssh = self.home / ".ssh"
        ssh.mkdir(parents=True, mode=0o700)
        Path("/run/sshd").mkdir(exist_ok=True)
        for key in (ssh / "id_ed25519", self.folder / "host_key"):
            subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", str(key)], check=True)
        (self.folder / "authorized").write_bytes((ssh / "id_ed25519.pub").read_bytes())
        known = (self.folder / "host_key.pub").read_text().split()[:2]
        lines = [f"{self.address(name)} {' '.join(known)}\n" for name in self.names]
        (ssh / "known_hosts").write_text("".join(lines))
        for name in self.names:
            self.serve(name)

    def serve(self, name: str, authorized: str = "authorized") -> None:
        """Start an sshd on the machine in place of a running one; `authorized` is the file of accepted keys."""
        if name in self._servers:
            self._end_server(self._servers.pop(name))
        settings = {
            "ListenAddress": self.address(name),
            "HostKey": self.folder / "host_key",
            "AuthorizedKeysFile": self.folder / authorized,
            "PidFile": "none",
            "UsePAM": "no",
            "StrictModes": "no",
            "PasswordAuthentication": "no",
            "KbdInteractiveAuthentication": "no",
            "PermitRootLogin": "prohibit-password",
            "LogLevel": "ERROR",
        }
        if name in self._shells:
            settings["ForceCommand"] = self._shells[name]
        config = self.folder / f"sshd-{name}"
        config.write_text("".join(f"{key} {value}\n" for key, value in settings.items()))
        enter = self.net.enter(self._number(name))
        log = (self.folder / f"sshd-{name}.log").open("ab")
        command = [*enter, SSHD, "-D", "-e", "-f", str(config)]
        self._servers[name] = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=log, stderr=log)

    def close(self) -> None:
        """End the remaining processes of the fleet, and only those."""
        for name in self.names:
            self.kill(name)
        for server in self._servers.values():
            self._end_server(server)

    @staticmethod
    def _end_server(server: subprocess.Popen[bytes]) -> None:
        server.kill()
        server.wait()

    # --- properties ------------------------------------------------------------------------------------------------

    def address(self, name: str) -> str:
        number = self._number(name)
        return self.net.address6(number) if self._six else self.net.address(number)

    def state(self, name: str) -> Path:
        return self.folder / name

    def write(self, top: str = "", hosts: Mapping[str, Mapping[str, str]] | None = None, tail: str = "") -> Path:
        """Write a fleet file of all machines and return its path; `hosts` overrides values of single machines."""
        lines = [top]
        for name in self.names:
            said = {"address": self.address(name), "user": "root", "python": sys.executable}
            said |= {"state": str(self.state(name)), **(hosts or {}).get(name, {})}
            lines += [f"[hosts.{name}]", *(f'{key} = "{value}"' for key, value in said.items())]
        self.fleet_file.write_text("\n".join([*lines, tail, ""]))
        return self.fleet_file

    def python(self, name: str, *, version: str | None = None, startup: str = "") -> str:
        """Create a virtual environment with this one's packages, whose `lfa` reports `version`; return its python."""
        venv = self.folder / f"venv-{name}"
        site = venv / "lib" / f"python{sys.version_info[0]}.{sys.version_info[1]}" / "site-packages"
        site.mkdir(parents=True)
        (venv / "bin").mkdir()
        (venv / "bin/python").symlink_to(Path(sys.executable).resolve())
        (venv / "pyvenv.cfg").write_text(f"home = {Path(sys.executable).resolve().parent}\n")
        (site / "all.pth").write_text("".join(f"{path}\n" for path in sys.path if path.endswith("-packages")))
        (site / "here.pth").write_text(f"{Path(__file__).parents[2] / '.namespace'}\n")
        (site / "sitecustomize.py").write_text(startup)
        if version is not None:
            (site / f"lfa-{version}.dist-info").mkdir()
            metadata = f"Metadata-Version: 2.1\nName: lfa\nVersion: {version}\n"
            (site / f"lfa-{version}.dist-info/METADATA").write_text(metadata)
        return str(venv / "bin/python")

    def part(self, name: str) -> HostPlan:
        return host_plan.read(self.state(name) / host_plan.PART)

    def processes(self, name: str) -> list[Identity]:
        """Return the processes of the fleet on that machine, found by its state folder in the command line."""
        mark = str(self.state(name))
        found = [
            one
            for one in identity.own_processes()
            if any(word.startswith((f"unixsock-stream/{mark}/", f"{mark}/")) for word in one.arguments)
        ]
        self._known.update(found)
        return found

    def sockets(self, name: str) -> list[str]:
        listed = Path("/proc/net/unix").read_text().splitlines()
        return [line.split()[-1] for line in listed if str(self.state(name)) in line] + [
            str(path) for path in self.state(name).glob("*.sock*")
        ]

    def keep(self) -> Path:
        """Copy the state folders of all machines, with their journals and logs, to where they survive the test."""
        kept = Path(tempfile.mkdtemp(prefix=KEPT, dir="/tmp"))
        for name in self.names:
            shutil.copytree(
                self.state(name), kept / name, ignore=_no_file, ignore_dangling_symlinks=True, copy_function=_copy
            )
        return kept

    # --- actions ---------------------------------------------------------------------------------------------------

    def lfa(
        self, *arguments: str, on: int = OPERATOR, python: Path | None = None, timeout_s: float = 90.0
    ) -> subprocess.CompletedProcess[str]:
        """Run `lfa ARGUMENTS` on one of the hosts, by default on the operator's, with this Python or with another."""
        command = [*self.net.enter(on), *self._words(arguments, python)]
        return self._run(command, timeout_s)

    def lfa_from_afar(self, *arguments: str, timeout_s: float = 90.0) -> subprocess.CompletedProcess[str]:
        """Run `lfa ARGUMENTS` on the operator's host, where no process of the fleet can be seen."""
        return self._run([*self.net.enter(OPERATOR), *ALONE, *self._words(arguments, None)], timeout_s)

    def lfa_begins(self, *arguments: str, on: int = OPERATOR) -> subprocess.Popen[str]:
        """Start `lfa ARGUMENTS` on one of the hosts; the caller ends it."""
        command = [*self.net.enter(on), *self._words(arguments, None)]
        pipe = subprocess.PIPE
        return subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True, env=self._environment(), cwd=self.folder)

    @staticmethod
    def _words(arguments: tuple[str, ...], python: Path | None) -> tuple[str, ...]:
        return (LFA[0] if python is None else str(python), *LFA[1:], *arguments)

    def _environment(self) -> dict[str, str]:
        environment = {**os.environ, "HOME": str(self.home)}
        environment.pop("SSH_AUTH_SOCK", None)
        return environment

    def _run(self, command: list[str], timeout_s: float) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            command,
            capture_output=True,
            text=True,
            timeout=timeout_s,
            check=False,
            env=self._environment(),
            cwd=self.folder,
        )

    def kill(self, name: str) -> float:
        """Kill all processes of that machine at once, its supervisor first; return the time [s] just before."""
        at = clock.now()
        found = self.processes(name)
        for one in sorted(found, key=lambda one: "lfa.deploy.fleet.host.supervisor" not in one.arguments):
            identity.send_signal(one, signal.SIGKILL)
        return at

    def kill_router(self, name: str) -> float:
        at = clock.now()
        router = next(one for one in self.processes(name) if "lfa.deploy.fleet.host.router" in one.arguments)
        assert identity.send_signal(router, signal.SIGKILL)
        return at

    def host(self, name: str) -> int:
        return self._number(name)

    def _number(self, name: str) -> int:
        return self.names.index(name) + 1


def _no_file(folder: str, names: list[str]) -> list[str]:
    """Return the names in `folder` that cannot be copied: sockets."""
    return [name for name in names if (Path(folder) / name).is_socket()]


def _copy(source: str, target: str) -> None:
    """Copy a file, unless the fleet, which runs on, has removed it since the folder was listed."""
    with suppress(FileNotFoundError):
        shutil.copy2(source, target)


@contextmanager
def machines(count: int, *, six: bool = False, shells: Mapping[str, str] | None = None) -> Iterator[Machines]:
    """Create `count` machines and an operator's; all their processes and files are removed at the end of the block.

    With `six` their addresses are of IPv6. `shells` are commands that sshd runs in place of the one asked for.
    """
    folder = Path(tempfile.mkdtemp(prefix="lfa-", dir="/tmp"))
    try:
        with Net(count + 1) as net:
            made = Machines(net, folder, count, six=six, shells=shells or {})
            try:
                made.open()
                yield made
            finally:
                made.close()
    finally:
        shutil.rmtree(folder, ignore_errors=True)
