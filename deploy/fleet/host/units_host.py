"""A machine whose engine is systemd: its unit files, lingering, start at boot, and their removal."""

from __future__ import annotations

import getpass
import os
import subprocess
import sys
from contextlib import suppress

from lfa.deploy.fleet.engine.systemd import ANSWER_S, check_here, systemctl, unit_folder
from lfa.deploy.fleet.engine.units import SUPERVISOR_NAME, Scope, services_of, target_of, units
from lfa.deploy.fleet.host.ledger import SUPERVISOR
from lfa.deploy.fleet.plan import host_plan
from lfa.deploy.fleet.plan.host_plan import HostPlan
from lfa.deploy.process.process_group import ProcessSpec
from lfa.protocol.errors import Refused


def scope_of(part: HostPlan) -> Scope:
    """Return whose systemd runs this machine's processes."""
    return "system" if part.engine == "systemd-system" else "user"


def check_units(part: HostPlan) -> None:
    """Raise Refused unless this user can run units here."""
    scope = scope_of(part)
    if scope == "system" and os.geteuid() != 0:
        raise Refused("--system: only root can install system units, log in as root or leave it out")
    check_here(scope)


def start_units(part: HostPlan) -> str:
    """Write and start the units; return what the user should know, such as that lingering was turned on.

    Raises Refused.
    """
    scope = scope_of(part)
    note = "" if scope == "system" else _linger()
    rows = [
        *host_plan.rows(part),
        ProcessSpec(SUPERVISOR_NAME, (SUPERVISOR, str(part.folder / host_plan.PART))),
    ]
    made = units(part.fleet, part.host, rows, part.restart, part.folder, sys.executable, scope)
    folder = unit_folder(scope)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in made.items():
            (folder / name).write_text(text)
    except OSError as error:
        raise Refused(f"{folder}: {error.strerror}: must be a folder to write to") from None
    target = target_of(part.fleet, part.host)
    systemctl(scope, "daemon-reload")
    if part.boot:
        systemctl(scope, "enable", target)
    systemctl(scope, "start", target)
    return note


def stop_units(part: HostPlan) -> None:
    """Stop the units and remove their files. Raises Refused when systemd does not."""
    scope, target = scope_of(part), target_of(part.fleet, part.host)
    folder = unit_folder(scope)
    if not (folder / target).exists():
        return
    systemctl(scope, "stop", target)
    with suppress(Refused):  # it was not enabled
        systemctl(scope, "disable", target)
    for name in (*services_of((folder / target).read_text(encoding="utf-8")), target):
        (folder / name).unlink(missing_ok=True)
    systemctl(scope, "daemon-reload")


def _linger() -> str:
    """Let the user's processes run on without a login; return a note when that is new. Raises Refused."""
    user = getpass.getuser()
    if _loginctl("show-user", user, "--property=Linger", "--value") == "yes":
        return ""
    if _loginctl("enable-linger", user) is None:
        right = f"an administrator can turn it on (loginctl enable-linger {user}), or use lfa up --system"
        raise Refused(f"lingering of user {user} is off, so its processes would end with its login: {right}")
    return f"lingering is now on for user {user}: processes run on without a login (loginctl disable-linger {user})"


def _loginctl(*words: str) -> str | None:
    """Return the output of loginctl, None when it fails."""
    try:
        done = subprocess.run(["loginctl", *words], capture_output=True, text=True, timeout=ANSWER_S, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return None
    return done.stdout.strip() if done.returncode == 0 else None
