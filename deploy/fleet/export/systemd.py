"""systemd: the units of each machine, for root to install; keys and scenario below `/var/lib/lfa`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from lfa.deploy.fleet.engine.units import target_of, units
from lfa.deploy.fleet.plan.host_plan import KEYS, HostPlan, rows
from lfa.deploy.recording.run_folder import SCENARIO

STATE = "/var/lib/lfa"
PYTHON = "/opt/lfa/bin/python"
USER = "lfa"
RUN = "run"


def systemd(shares: Mapping[str, HostPlan]) -> dict[str, str]:
    """Return the files of the export by path: a folder for each machine, with `install.sh`."""
    files: dict[str, str] = {}
    for host, part in shares.items():
        made = units(part.fleet, host, rows(part), part.restart, part.folder, PYTHON, "system", USER)
        files |= {f"{host}/units/{name}": text for name, text in made.items()}
        files |= {f"{host}/keys/{name}": text for name, text in part.bundle.items()}
        files[f"{host}/scenario.toml"] = part.scenario
        files[f"{host}/install.sh"] = _install(part)
    return files


def state_of(fleet: str, host: str) -> str:
    """Return the state folder of a fleet on a machine."""
    return f"{STATE}/{fleet}/{host}"


def _install(part: HostPlan) -> str:
    folder, run = part.folder, Path(part.folder) / RUN
    keys = folder / KEYS
    lines = [
        "#!/bin/sh",
        f"# Machine {part.host} of fleet {part.fleet}: run as root in this folder, then remove keys/.",
        f"# Needs lfa in {Path(PYTHON).parent.parent}: python3 -m venv, then pip install 'lfa[world]'.",
        "set -eu",
        f"id {USER} > /dev/null 2>&1 || useradd --system --no-create-home {USER}",
        f"install -d -o {USER} -g {USER} -m 700 {folder} {run} {keys}",
        f"install -o {USER} -g {USER} -m 600 scenario.toml {run}/{SCENARIO}",
        f"install -o {USER} -g {USER} -m 600 -t {keys} keys/*",
        "install -m 644 -t /etc/systemd/system units/*",
        "systemctl daemon-reload",
        f"systemctl enable --now {target_of(part.fleet, part.host)}",
    ]
    return "\n".join([*lines, ""])
