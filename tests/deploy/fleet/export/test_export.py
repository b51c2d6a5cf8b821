"""`lfa export`: what each engine gets is whole, locked up, and holds each key at its owner's service only."""

from __future__ import annotations

import json
import os
import re
import shutil
import stat
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from lfa.agents import cli as agent_cli
from lfa.deploy.fleet.engine.units import quoted
from lfa.deploy.fleet.export.command import command, exported
from lfa.deploy.fleet.export.services import FleetServices, secured, services
from lfa.deploy.fleet.export.yaml_text import yaml_text
from lfa.deploy.fleet.plan.fleet_file import FleetPlan, load
from lfa.deploy.fleet.remote.key_distribution import bundles
from lfa.protocol import clock
from lfa.protocol.errors import Refused
from lfa.protocol.transport.credentials import credentials

TEXT = """
fleet = "convoy"
scenario = "straight"
team = 3
keys = "{keys}"
[hosts.a]
address = "10.0.0.1"
[hosts.b]
address = "10.0.0.2"
"""
ENGINES = ("systemd", "quadlet", "compose", "kubernetes", "nomad")


@pytest.fixture(scope="module")
def plan(tmp_path_factory: pytest.TempPathFactory) -> FleetPlan:
    folder = tmp_path_factory.mktemp("export")
    file = folder / "convoy.toml"
    file.write_text(TEXT.format(keys=folder / "keys"))
    return secured(load(file))


@pytest.fixture(scope="module")
def fleet(plan: FleetPlan) -> FleetServices:
    return services(plan, bundles(plan), "names")


def documents(text: str) -> list[dict[str, Any]]:
    return list(yaml.safe_load_all(text))


def test_every_process_of_the_plan_is_a_service(fleet: FleetServices) -> None:
    assert {(one.name, one.host) for one in fleet.services} == {
        ("router-a", "a"), ("world", "a"), ("robot1", "a"), ("robot3", "a"), ("router-b", "b"), ("robot2", "b"),
    }  # fmt: skip


def test_each_service_holds_its_own_keys_and_they_are_good(fleet: FleetServices, tmp_path: Path) -> None:
    for one in fleet.services:
        folder = tmp_path / one.name
        folder.mkdir()
        for file, text in one.keys.items():
            (folder / file).write_text(text)
            (folder / file).chmod(0o600)
        name = one.name.replace("router-", "host-")
        credentials(folder, name, clock.wall_ms())
        assert {path.stem for path in folder.glob("*.key")} <= {name, "witness"}, "and nobody else's"


def test_robots_know_their_routers_by_the_names_in_the_certificates(fleet: FleetServices) -> None:
    robot = next(one for one in fleet.services if one.name == "robot2")
    known = agent_cli._parser().parse_args(list(robot.command[1:]))
    assert (known.id, known.fleet, known.connect) == ("2", "convoy", "tls/b:7447,tls/a:7447")


@pytest.mark.parametrize("engine", ENGINES)
def test_no_key_is_written_where_the_engine_has_secrets_for_it(plan: FleetPlan, engine: str) -> None:
    """Private keys are in files of their own: key files, Secrets, variables; in no manifest and no unit."""
    for path, text in exported(engine, plan).items():
        apart = re.search(r"(^|/)(keys|variables)/|secrets\.yaml$", path)
        assert apart or "PRIVATE KEY" not in text, path


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="needs systemd-analyze")
@pytest.mark.parametrize("host", ["a", "b"])
def test_systemd_takes_the_units(plan: FleetPlan, tmp_path: Path, host: str) -> None:
    units = {p: t for p, t in exported("systemd", plan).items() if p.startswith(f"{host}/units/")}
    for path, text in units.items():
        there = text.replace("/opt/lfa/bin/python", sys.executable).replace("User=lfa", "User=root")
        (tmp_path / Path(path).name).write_text(there)
    paths = sorted(str(path) for path in tmp_path.iterdir())
    verify = ["systemd-analyze", "verify", "--man=no", "--recursive-errors=no", *paths]
    done = subprocess.run(verify, capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def test_units_are_bound_watched_limited_and_locked_up(plan: FleetPlan) -> None:
    files = exported("systemd", plan)
    unit = files["b/units/lfa-convoy-b-robot2.service"]
    wanted = ("PartOf=lfa-convoy-b.target", "WatchdogSec=5", "MemoryMax=256M", "NoNewPrivileges=yes", "User=lfa",
              "Type=notify", "ProtectSystem=strict", "ReadWritePaths=/var/lib/lfa/convoy/b")  # fmt: skip
    assert [line for line in wanted if line not in unit.splitlines()] == []
    assert "Wants=lfa-convoy-b-router.service lfa-convoy-b-robot2.service" in files["b/units/lfa-convoy-b.target"]


def test_compose_gives_each_service_its_secrets(plan: FleetPlan) -> None:
    files = exported("compose", plan)
    (compose,) = documents(files["compose.yaml"])
    for name, one in compose["services"].items():
        assert one["read_only"] and one["cap_drop"] == ["ALL"] and one["mem_limit"]
        for secret in one["secrets"]:
            path = compose["secrets"][secret["source"]]["file"]
            assert path.startswith(f"./keys/{name}/") and path.removeprefix("./") in files
    assert compose["services"]["router-b"]["networks"]["fleet"]["aliases"] == ["b"]


def test_kubernetes_mounts_a_secret_of_its_own_into_each_pod(plan: FleetPlan) -> None:
    files = exported("kubernetes", plan)
    secrets = {one["metadata"]["name"]: one["stringData"] for one in documents(files["secrets.yaml"])}
    made = documents(files["lfa.yaml"])
    for one in (one for one in made if one["kind"] == "Deployment"):
        pod, name = one["spec"]["template"]["spec"], one["metadata"]["name"]
        assert pod["securityContext"]["runAsNonRoot"] is True
        assert pod["containers"][0]["securityContext"]["readOnlyRootFilesystem"] is True
        assert pod["volumes"][0]["secret"]["secretName"] == f"keys-{name}" in secrets
    assert {one["metadata"]["name"] for one in made if one["kind"] == "Service"} == {"a", "b"}


@pytest.mark.skipif(shutil.which("kubectl") is None, reason="needs kubectl")
def test_kubectl_reads_the_manifests(plan: FleetPlan, tmp_path: Path) -> None:
    for path, text in exported("kubernetes", plan).items():
        (tmp_path / path).write_text(text)
    (tmp_path / "kustomization.yaml").write_text("resources: [lfa.yaml, secrets.yaml]\n")
    done = subprocess.run(["kubectl", "kustomize", str(tmp_path)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert len(documents(done.stdout)) == 17


def test_quadlet_mounts_podman_secrets_that_its_script_makes(plan: FleetPlan) -> None:
    files = exported("quadlet", plan)
    script = files["b/install.sh"]
    unit = files["b/lfa-convoy-robot2.container"]
    named = re.findall(r"(?m)^Secret=([^,]+),type=mount,target=/keys/", unit)
    assert len(named) == 4
    assert all(f"podman secret create --replace {name} " in script for name in named)
    assert "Notify=true" in unit and "WatchdogSec=5" in unit


def test_nomad_reads_keys_from_variables_of_its_own_path(plan: FleetPlan) -> None:
    files = exported("nomad", plan)
    job = json.loads(files["lfa.nomad.json"])["Job"]
    for group in job["TaskGroups"]:
        for task in group["Tasks"]:
            variable = json.loads(files[f"variables/{task['Name']}.json"])
            assert variable["Path"] == f"nomad/jobs/{job['ID']}/{group['Name']}/{task['Name']}"
            for template in (one for one in task["Templates"] if "nomadVar" in one["EmbeddedTmpl"]):
                item = re.search(r"{{ \.(\w+) }}", template["EmbeddedTmpl"])
                assert item is not None and item[1] in variable["Items"] and template["Perms"] == "0600"


@pytest.mark.parametrize("engine", ["systemd", "quadlet", "nomad"])
def test_the_scripts_are_shell(plan: FleetPlan, engine: str) -> None:
    scripts = [text for path, text in exported(engine, plan).items() if path.endswith("install.sh")]
    assert scripts
    for text in scripts:
        assert subprocess.run(["sh", "-n"], input=text, text=True, check=False).returncode == 0


def test_what_is_written_only_its_owner_reads(plan: FleetPlan, tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert command("kubernetes", plan.path, out) == 0
    modes = {stat.S_IMODE(path.stat().st_mode) for path in out.iterdir()}
    assert (modes, stat.S_IMODE(out.stat().st_mode)) == ({0o600}, 0o700)


def test_a_folder_with_something_in_it_is_refused_and_left(plan: FleetPlan, tmp_path: Path) -> None:
    (tmp_path / "mine").write_text("x")
    with pytest.raises(Refused, match="must be a new or an empty folder"):
        command("compose", plan.path, tmp_path)
    assert os.listdir(tmp_path) == ["mine"]


def test_a_port_that_the_engine_cannot_give_is_refused(plan: FleetPlan, tmp_path: Path) -> None:
    file = tmp_path / "convoy.toml"
    file.write_text(plan.path.read_text() + "router_port = 9000\n")
    with pytest.raises(Refused, match=r"hosts\.b\.router_port: must be 7447"):
        command("kubernetes", file, tmp_path / "out")
    assert not (tmp_path / "out").exists()


plain = st.recursive(
    st.text(max_size=20) | st.integers() | st.booleans(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text("abc-_.9", min_size=1), inner, max_size=3),
    max_leaves=10,
)


@given(st.dictionaries(st.text("abcxyz-_.09", min_size=1, max_size=8), plain, min_size=1, max_size=4))
def test_yaml_text_is_read_back_as_it_was(value: dict[str, Any]) -> None:
    assert yaml.safe_load(yaml_text(value)) == value


@pytest.mark.parametrize(
    ("word", "unit"),
    [("a-b/c.d", "a-b/c.d"), ("", '""'), ("a b", '"a b"'), ("50%", '"50%%"'), ("$x", '"$$x"'), ('a"b', '"a\\"b"')],
)
def test_a_units_command_line_keeps_each_word(word: str, unit: str) -> None:
    assert quoted(word) == unit
