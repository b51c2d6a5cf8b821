"""The templates: as far as this machine can tell, systemd, Docker, Kubernetes and Zenoh would take them as they are."""

from __future__ import annotations

import configparser
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml
import zenoh

from lfa.agents import cli as agent_cli
from lfa.deploy.fleet.security import keys, registry
from lfa.deploy.robot import cli as driver_cli
from lfa.protocol.transport.bus import Inbox
from lfa.protocol.transport.zenoh_bus import ZenohBus
from tests.rigs.lfa_runs import eventually
from tests.rigs.secured_fleet import free_port

ROOT = Path(__file__).parents[3]
TEMPLATES = ROOT / "deploy" / "fleet" / "templates"
UNITS = sorted((TEMPLATES / "systemd").glob("*.service"))


# --- systemd --------------------------------------------------------------------------------------------------------


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="needs systemd-analyze")
def test_systemd_takes_the_units(tmp_path: Path) -> None:
    """With the scripts where this environment has them, and a user that exists."""
    for unit in UNITS:
        text = unit.read_text().replace("/opt/lfa/bin/", f"{Path(sys.executable).parent}/")
        (tmp_path / unit.name.replace("@", "@3")).write_text(re.sub("(?m)^(User|Group)=lfa$", r"\1=root", text))
    paths = [str(path) for path in sorted(tmp_path.iterdir())]
    command = ["systemd-analyze", "verify", "--man=no", "--recursive-errors=no", *paths]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def service(unit: Path) -> dict[str, str]:
    parser = configparser.ConfigParser(interpolation=None, strict=False)
    parser.optionxform = str  # type: ignore[assignment,method-assign]
    parser.read_string(unit.read_text())
    return dict(parser["Service"])


@pytest.mark.parametrize("unit", UNITS, ids=lambda unit: unit.name)
def test_a_unit_is_locked_up_and_starts_again(unit: Path) -> None:
    facts = service(unit)
    assert facts["User"] == "lfa" and facts["NoNewPrivileges"] == "yes" and facts["ProtectSystem"] == "strict"
    assert facts["CapabilityBoundingSet"] == ""
    assert facts["Restart"] in ("always", "on-failure")


@pytest.mark.parametrize(
    "name", ["lfa-agent@.service", "lfa-driver@.service", "lfa-world.service", "lfa-router.service"]
)
def test_the_loop_is_watched(name: str) -> None:
    facts = service(TEMPLATES / "systemd" / name)
    assert facts["Type"] == "notify" and int(facts["WatchdogSec"]) >= 3, "the loop tells of itself once a second"


def test_the_instance_is_the_robots_id() -> None:
    environment = {"LFA_FLEET": "f", "LFA_SOCKET": "unixsock-stream//run/x", "LFA_START": "0,-1,0", "LFA_OPTIONS": ""}
    for name, parser in (("lfa-agent@", agent_cli._parser()), ("lfa-driver@", driver_cli._parser())):
        line = service(TEMPLATES / "systemd" / f"{name}.service")["ExecStart"].replace("%i", "7")
        words = [re.sub(r"\$\{?(\w+)\}?", lambda m: environment[m[1]], word) for word in line.split()[1:]]
        arguments = parser.parse_args([word for word in words if word])
        assert int(arguments.id) == 7 and arguments.fleet == "f"


def test_the_environment_file_has_all_that_the_units_want() -> None:
    given = {line.partition("=")[0] for line in (TEMPLATES / "systemd" / "lfa.env").read_text().splitlines()}
    wanted = {name for unit in UNITS for name in re.findall(r"\$\{?(LFA_\w+)", unit.read_text())}
    assert wanted <= given


# --- containers -----------------------------------------------------------------------------------------------------


def test_the_agents_image_is_the_base_install() -> None:
    text = (TEMPLATES / "docker" / "Dockerfile").read_text()
    stages = dict(re.findall(r"(?ms)^FROM \S+ AS (\w+)\n(.*?)(?=^FROM|\Z)", text))
    assert set(stages) == {"base", "agent", "world"}
    assert re.search(r"pip install -c constraints.txt \. &&", stages["agent"]) and "[" not in re.sub(
        r"(?m)^(ENTRYPOINT|CMD) .*$", "", stages["agent"]
    )
    assert all("USER 10001" in stages[name] for name in ("agent", "world"))
    for source in re.findall(r"(?m)^COPY (.*) \S+$", text):
        assert all((ROOT / word).exists() for word in source.split()), source


def arguments_of_agents(command: list[str]) -> tuple[str, str, str]:
    known = agent_cli._parser().parse_args(command)
    return known.role, known.id, known.connect


def test_compose_has_a_router_a_world_and_agents() -> None:
    file = TEMPLATES / "docker" / "compose.yaml"
    services: dict[str, Any] = yaml.safe_load(file.read_text())["services"]
    team = {name: one for name, one in services.items() if name.startswith("robot")}
    assert set(services) == {"router", "world", *team} and len(team) == 4
    for name, one in team.items():
        role, robot, connect = arguments_of_agents(one["command"])
        assert (name, connect) == (f"robot{robot}", "tcp/router:7447")
        assert role == ("leader" if robot == "1" else "follower")
    build = services["world"]["build"]
    assert (file.parent / build["context"]).resolve() == ROOT
    assert (ROOT / build["dockerfile"]).exists() and build["target"] == "world"
    assert services["world"]["command"][1:3] == ["--robots", str(len(team))]


def kubernetes() -> dict[tuple[str, str], dict[str, Any]]:
    documents = yaml.safe_load_all((TEMPLATES / "kubernetes" / "lfa.yaml").read_text())
    return {(one["kind"], one["metadata"]["name"]): one for one in documents}


def test_a_pods_ordinal_is_the_robots_id() -> None:
    spec = kubernetes()["StatefulSet", "lfa-agent"]["spec"]
    assert spec["ordinals"] == {"start": 1}
    container = spec["template"]["spec"]["containers"][0]
    path = container["env"][0]["valueFrom"]["fieldRef"]["fieldPath"]
    assert path == "metadata.labels['apps.kubernetes.io/pod-index']"
    words = [word.replace(f"$({container['env'][0]['name']})", "3") for word in container["args"]]
    assert arguments_of_agents(words) == ("follower", "3", "tcp/lfa-router:7447")


def test_selectors_ports_and_names_belong_together() -> None:
    found = kubernetes()
    assert {kind for kind, _ in found} == {"Namespace", "Service", "Deployment", "StatefulSet", "NetworkPolicy"}
    pods = [one["spec"]["template"] for (kind, _), one in found.items() if kind in ("Deployment", "StatefulSet")]
    for (kind, name), one in found.items():
        assert one["apiVersion"] in ("v1", "apps/v1", "networking.k8s.io/v1") and kind
        if kind in ("Deployment", "StatefulSet"):
            assert one["spec"]["selector"]["matchLabels"] == one["spec"]["template"]["metadata"]["labels"], name
    wanted = found["Service", "lfa-router"]["spec"]["selector"]
    chosen = [pod for pod in pods if wanted.items() <= pod["metadata"]["labels"].items()]
    assert [port["name"] for port in chosen[0]["spec"]["containers"][0]["ports"]] == ["zenoh"] and len(chosen) == 1
    team = found["StatefulSet", "lfa-agent"]["spec"]["replicas"]
    assert str(team) in found["StatefulSet", "lfa-world"]["spec"]["template"]["spec"]["containers"][0]["args"]


def test_every_pod_is_as_locked_up_as_its_namespace_demands() -> None:
    for (kind, name), one in kubernetes().items():
        if kind not in ("Deployment", "StatefulSet"):
            continue
        pod = one["spec"]["template"]["spec"]
        assert pod["securityContext"]["runAsNonRoot"] and pod["securityContext"]["seccompProfile"], name
        for container in pod["containers"]:
            locked = container["securityContext"]
            assert locked["allowPrivilegeEscalation"] is False and locked["capabilities"] == {"drop": ["ALL"]}, name
            assert locked["readOnlyRootFilesystem"] and "memory" in container["resources"]["limits"], name


# --- Zenoh ----------------------------------------------------------------------------------------------------------


@pytest.mark.processes
def test_zenoh_takes_the_configurations_and_lfa_talks_through_them(tmp_path: Path) -> None:
    keys.make(tmp_path / "k", keys.spread("f", {"a": (), "machine-b": ()}, [1]))
    port = free_port()
    configs = {}
    for name in ("router", "client"):
        text = (TEMPLATES / "zenoh" / f"{name}.json5").read_text()
        text = text.replace("/etc/lfa/keys", str(registry.folder_of(tmp_path / "k", "a")))
        text = text.replace("/run/lfa/router.sock", str(tmp_path / "z.sock")).replace(
            "0.0.0.0:7447", f"127.0.0.1:{port}"
        )
        (tmp_path / f"{name}.json5").write_text(text)
        configs[name] = zenoh.Config.from_file(str(tmp_path / f"{name}.json5"))
    inbox = Inbox()
    with zenoh.open(configs["router"]), zenoh.open(configs["client"]) as client:
        bus = ZenohBus(f"unixsock-stream/{tmp_path / 'z.sock'}", inbox)
        try:
            bus.follow(frozenset({"lfa/f/robot1/obstacles"}))

            def heard() -> bool:
                client.put("lfa/f/robot1/obstacles", b"here")
                return any(arrival.payload == b"here" for arrival in inbox.take())

            eventually(heard, "nothing comes through")
        finally:
            bus.close()


# --- the package ----------------------------------------------------------------------------------------------------


def test_the_wheel_ships_the_templates() -> None:
    import io
    import zipfile

    from lfa.deploy.fleet.remote.wheel import pack

    names = set(zipfile.ZipFile(io.BytesIO(pack()[1])).namelist())
    for path in TEMPLATES.rglob("*"):
        assert path.is_dir() or f"lfa/{path.relative_to(ROOT)}" in names
