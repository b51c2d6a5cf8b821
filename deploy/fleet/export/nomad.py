"""Nomad: a group a machine and a task a service, as a job in JSON (`nomad job run -json`); keys as Nomad variables."""

from __future__ import annotations

import json
from typing import Any

from lfa.deploy.fleet.export.services import USER, FleetServices, Service

SECONDS = 1_000_000_000
"""Nanoseconds, the unit of durations in a job's JSON."""


def nomad(fleet: FleetServices) -> dict[str, str]:
    """Return the files of the export by path: the job, its variables, and the commands that install both."""
    name = f"lfa-{fleet.fleet}"
    job = {
        "ID": name,
        "Name": name,
        "Type": "service",
        "Datacenters": ["*"],
        "TaskGroups": [_group(fleet, host) for host in fleet.hosts],
    }
    variables = {
        f"variables/{one.name}.json": json.dumps({"Path": _path(fleet, one), "Items": _items(one)}, indent=1) + "\n"
        for one in fleet.services
    }
    lines = ["#!/bin/sh", "set -eu", *(f"nomad var put -force @{file}" for file in variables)]
    install = "\n".join([*lines, "nomad job run -json lfa.nomad.json", ""])
    return {"lfa.nomad.json": json.dumps({"Job": job}, indent=1) + "\n", "install.sh": install, **variables}


def _path(fleet: FleetServices, one: Service) -> str:
    """Return the path of a task's variables, which that task alone may read without further rights."""
    return f"nomad/jobs/lfa-{fleet.fleet}/{one.host}/{one.name}"


def _items(one: Service) -> dict[str, str]:
    """Return the key files; a variable's item has no dot in its name."""
    return {_item(file): text for file, text in one.keys.items()}


def _item(file: str) -> str:
    return file.replace(".", "_").replace("-", "_")


def _group(fleet: FleetServices, host: str) -> dict[str, Any]:
    return {
        "Name": host,
        "Count": 1,
        "Constraints": [{"LTarget": "${attr.unique.hostname}", "RTarget": host, "Operand": "="}],
        "RestartPolicy": {"Attempts": 5, "Interval": 60 * SECONDS, "Delay": SECONDS // 2, "Mode": "delay"},
        "Tasks": [_task(fleet, one) for one in fleet.on(host)],
    }


def _task(fleet: FleetServices, one: Service) -> dict[str, Any]:
    program, *arguments = one.command
    path = _path(fleet, one)
    templates = [
        _template(f'{{{{ with nomadVar "{path}" }}}}{{{{ .{_item(file)} }}}}{{{{ end }}}}', f"secrets/{file}", "0600")
        for file in one.keys
    ]
    places = {"/keys": "/secrets", "/scenario/scenario.toml": "/local/scenario.toml"}
    if one.scenario:
        templates.append(_template(fleet.scenario, "local/scenario.toml", "0644", plain=True))
    return {
        "Name": one.name,
        "Driver": "docker",
        "User": str(USER),
        "Config": {
            "image": one.image,
            "entrypoint": [program],
            "args": [places.get(word, word) for word in arguments],
            "network_mode": "host",
            "readonly_rootfs": True,
            "cap_drop": ["all"],
            "security_opt": ["no-new-privileges"],
        },
        "Templates": templates,
        "Resources": {"CPU": 200, "MemoryMB": one.memory_mib},
        "KillTimeout": 5 * SECONDS,
    }


def _template(text: str, path: str, mode: str, *, plain: bool = False) -> dict[str, Any]:
    """Return a file of a task; a `plain` text is no template: its delimiters occur in no scenario."""
    marks = {"LeftDelim": "<<<lfa", "RightDelim": "lfa>>>"} if plain else {}
    whose = {"Uid": USER, "Gid": USER} if not plain else {}
    return {"EmbeddedTmpl": text, "DestPath": path, "Perms": mode, "ChangeMode": "restart", **marks, **whose}
