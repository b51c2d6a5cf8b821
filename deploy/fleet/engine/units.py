"""systemd units of one machine's processes: services bound by a target, watched, limited and locked up. Pure.

The directives are those of the shipped templates (`fleet/templates/systemd`), with the fleet's own command lines.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Literal

from lfa.deploy.process.process_group import ROUTER_NAME, ProcessSpec
from lfa.deploy.process.restart_policy import REFUSED_CODE, Restart
from lfa.protocol.topics import WORLD_NAME

SUPERVISOR_NAME = "supervisor"
Scope = Literal["user", "system"]
"""Whose systemd: the user's own manager, or the machine's."""
WANTS = "Wants="
MEMORY_MAX = {ROUTER_NAME: "512M", WORLD_NAME: "1G"}
AGENT_MEMORY_MAX = "256M"
WANTED_BY: dict[Scope, str] = {"user": "default.target", "system": "multi-user.target"}
_CHARACTERS = frozenset("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_./:=,+@~")
"""Characters that stand for themselves in a command line of a unit."""

LOCKED_UP = """\
UMask=0077
NoNewPrivileges=yes
RestrictAddressFamilies=AF_UNIX AF_INET AF_INET6 AF_NETLINK
RestrictNamespaces=yes
RestrictRealtime=yes
RestrictSUIDSGID=yes
LockPersonality=yes
SystemCallArchitectures=native
SystemCallFilter=@system-service
"""
"""Sandbox of every service, also of a user's: what needs neither privileges nor user namespaces."""
OF_SYSTEM = """\
CapabilityBoundingSet=
ProtectSystem=strict
ProtectClock=yes
ProtectHostname=yes
ProtectControlGroups=yes
ProtectKernelLogs=yes
ProtectKernelModules=yes
ProtectKernelTunables=yes
PrivateDevices=yes
"""
"""What only the machine's systemd can restrict. The state folder is then the only place to write to."""


def stem(fleet: str, host: str) -> str:
    """Return the beginning of all unit names of a fleet on one machine."""
    return f"lfa-{fleet}-{host}"


def unit_of(fleet: str, host: str, name: str) -> str:
    """Return the unit of a process."""
    return f"{stem(fleet, host)}-{name}.service"


def target_of(fleet: str, host: str) -> str:
    """Return the target that binds the units of a fleet on one machine."""
    return f"{stem(fleet, host)}.target"


def units(
    fleet: str, host: str, rows: Sequence[ProcessSpec], restart: Restart, state: Path, python: str, scope: Scope,
    user: str = "",
) -> Mapping[str, str]:  # fmt: skip
    """Return the text of each unit file, by file name: a service for each process, and the target.

    `state`: folder that the processes may write to. `python`: interpreter. `user`: of a system's services.
    """
    made = {
        unit_of(fleet, host, row.name): _service(fleet, host, row, restart, state, python, scope, user) for row in rows
    }
    wanted = " ".join(made)
    made[target_of(fleet, host)] = (
        f"[Unit]\nDescription=lfa: fleet {fleet} on {host}\n{WANTS}{wanted}\n\n[Install]\nWantedBy={WANTED_BY[scope]}\n"
    )
    return made


def services_of(target: str) -> list[str]:
    """Return the names of the services that the text of a target binds.

    The beginning of their names would not do: that of a host `a` is one of a host `a-2`, too.
    """
    return next((line[len(WANTS) :].split() for line in target.splitlines() if line.startswith(WANTS)), [])


def _service(
    fleet: str, host: str, row: ProcessSpec, restart: Restart, state: Path, python: str, scope: Scope, user: str
) -> str:
    router = row.name == ROUTER_NAME
    policy = "on-failure" if row.name == SUPERVISOR_NAME else restart.policy
    again = "always" if router or policy == "always" else {"never": "no"}.get(policy, policy)
    limit = 0 if router else restart.window_s
    after = "" if router else f"After={unit_of(fleet, host, ROUTER_NAME)}\n"
    whose = f"User={user}\n" if scope == "system" and user else ""
    inside = f"{OF_SYSTEM}ReadWritePaths={quoted(str(state))}\n" if scope == "system" else ""
    command = " ".join(quoted(word) for word in (python, "-P", "-m", *row.arguments))
    return (
        f"[Unit]\nDescription=lfa: {row.name} of fleet {fleet}\nPartOf={target_of(fleet, host)}\n{after}"
        f"StartLimitIntervalSec={limit:g}\n" + (f"StartLimitBurst={restart.starts_max + 1}\n" if limit else "") + "\n"
        f"[Service]\nType=notify\n"
        "# Ready once it takes part; killed when its loop shows no sign of life for WatchdogSec.\n"
        f"TimeoutStartSec=infinity\nWatchdogSec={restart.watchdog_s:g}\nWatchdogSignal=SIGKILL\n"
        f"ExecStart={command}\n"
        f"Restart={again}\nRestartSec={restart.delay_s:g}\n"
        f"RestartPreventExitStatus={REFUSED_CODE}\nTimeoutStopSec=5\n"
        f"MemoryMax={MEMORY_MAX.get(row.name, AGENT_MEMORY_MAX)}\n"
        f"{whose}{LOCKED_UP}{inside}\n"
        f"[Install]\nWantedBy={target_of(fleet, host)}\n"
    )


def quoted(word: str) -> str:
    """Return a word of a command line as a unit has it: `%` and `$` doubled, in quotes if it has other characters."""
    doubled = word.replace("\\", "\\\\").replace("%", "%%").replace("$", "$$").replace('"', '\\"').replace("\n", "\\n")
    return doubled if word and set(word) <= _CHARACTERS else f'"{doubled}"'
