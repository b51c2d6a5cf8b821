"""Podman Quadlet: a `.container` file a service, for the systemd of each machine; keys as Podman secrets."""

from __future__ import annotations

from lfa.deploy.fleet.engine.units import quoted
from lfa.deploy.fleet.export.services import KEYS, SCENARIO, USER, FleetServices, Service


def quadlet(fleet: FleetServices) -> dict[str, str]:
    """Return the files of the export by path: a folder for each machine, with `install.sh`."""
    files: dict[str, str] = {}
    for host in fleet.hosts:
        for one in fleet.on(host):
            files[f"{host}/{_name(fleet, one)}.container"] = _container(fleet, one)
            files |= {f"{host}/keys/{one.name}/{file}": text for file, text in one.keys.items()}
        if any(one.scenario for one in fleet.on(host)):
            files[f"{host}/scenario.toml"] = fleet.scenario
        files[f"{host}/install.sh"] = _install(fleet, host)
    return files


def _name(fleet: FleetServices, one: Service) -> str:
    return f"lfa-{fleet.fleet}-{one.name}"


def _secret(fleet: FleetServices, one: Service, file: str) -> str:
    return f"{_name(fleet, one)}-{file}"


def _container(fleet: FleetServices, one: Service) -> str:
    router = next(other for other in fleet.on(one.host) if other.router)
    after = "" if one.router else f"After={_name(fleet, router)}.service\nWants={_name(fleet, router)}.service\n"
    program, *arguments = one.command
    secrets = "".join(
        f"Secret={_secret(fleet, one, file)},type=mount,target={KEYS}/{file},uid={USER},gid={USER},mode=0400\n"
        for file in one.keys
    )
    volume = f"Volume=/etc/lfa/{fleet.fleet}/scenario.toml:{SCENARIO}:ro,Z\n" if one.scenario else ""
    return (
        f"[Unit]\nDescription=lfa: {one.name} of fleet {fleet.fleet}\n{after}\n"
        f"[Container]\nImage=localhost/{one.image}\nEntrypoint={program}\n"
        f"Exec={' '.join(map(quoted, arguments))}\nNetwork=host\nUser={USER}\nReadOnly=true\nDropCapability=all\n"
        f"NoNewPrivileges=true\nNotify=true\n{secrets}{volume}"
        f"PodmanArgs=--memory={one.memory_mib}m\n\n"
        f"[Service]\nRestart={'always' if one.router else 'on-failure'}\nWatchdogSec=5\n"
        "TimeoutStartSec=infinity\nRestartPreventExitStatus=2\n\n"
        "[Install]\nWantedBy=default.target\n"
    )


def _install(fleet: FleetServices, host: str) -> str:
    """Return the commands that install one machine's containers, to be run there in this folder."""
    secrets = [
        f"podman secret create --replace {_secret(fleet, one, file)} keys/{one.name}/{file}"
        for one in fleet.on(host)
        for file in one.keys
    ]
    scenario = [f"install -D -m 644 scenario.toml /etc/lfa/{fleet.fleet}/scenario.toml"]
    lines = [
        "#!/bin/sh",
        f"# Machine {host} of fleet {fleet.fleet}: run as root in this folder, then remove keys/.",
        "set -eu",
        *(scenario if any(one.scenario for one in fleet.on(host)) else []),
        *secrets,
        "install -D -m 644 -t /etc/containers/systemd ./*.container",
        "systemctl daemon-reload",
        *(f"systemctl start {_name(fleet, one)}.service" for one in fleet.on(host)),
    ]
    return "\n".join([*lines, ""])
