"""Docker Compose: all machines of a fleet file as routers in one network, each under its machine's name."""

from __future__ import annotations

from lfa.deploy.fleet.export.services import SCENARIO, USER, FleetServices, Service
from lfa.deploy.fleet.export.yaml_text import Plain, yaml_text

KEY_FOLDER = "keys"


def compose(fleet: FleetServices, user: int = USER) -> dict[str, str]:
    """Return the files of the export by path. `user`: owner of the key files, which is the containers' user."""
    files = {f"{KEY_FOLDER}/{one.name}/{file}": text for one in fleet.services for file, text in one.keys.items()}
    document: dict[str, Plain] = {
        "name": f"lfa-{fleet.fleet}",
        "services": {one.name: _service(fleet, one, user) for one in fleet.services},
        "secrets": {
            _secret(one, file): {"file": f"./{KEY_FOLDER}/{one.name}/{file}"}
            for one in fleet.services
            for file in one.keys
        },
        "configs": {"scenario": {"file": "./scenario.toml"}},
        "networks": {"fleet": {"internal": True}},
    }
    return {"compose.yaml": yaml_text(document), "scenario.toml": fleet.scenario, **files}


def _secret(service: Service, file: str) -> str:
    return f"{service.name}-{file.replace('.', '-')}"


def _service(fleet: FleetServices, one: Service, user: int) -> Plain:
    made: dict[str, Plain] = {
        "image": one.image,
        "entrypoint": list(one.command),
        "user": f"{user}:{user}",
        "restart": "always" if one.router else "on-failure",
        "read_only": True,
        "cap_drop": ["ALL"],
        "security_opt": ["no-new-privileges:true"],
        "mem_limit": f"{one.memory_mib}m",
        "networks": {"fleet": {"aliases": [one.host]} if one.router else {}},
        "secrets": [
            {"source": _secret(one, file), "target": f"/keys/{file}", "mode": "0400", "uid": str(user)}
            for file in one.keys
        ],
    }
    if one.scenario:
        made["configs"] = [{"source": "scenario", "target": SCENARIO}]
    if not one.router:
        made["depends_on"] = [other.name for other in fleet.on(one.host) if other.router]
    return made
