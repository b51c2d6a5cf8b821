"""Every command of README.md runs as printed: here on a recorded run or a running fleet, or in the test named here."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.rigs.lfa_runs import Running, lfa, running
from tests.test_imports import ROOT

README = (ROOT / "README.md").read_text()
MAKEFILE = (ROOT / "Makefile").read_text()

ON_A_RUN = (
    "lfa verify RUN...", "lfa report RUN", "lfa report A B", "lfa replay RUN --robot 2", "lfa plot RUN", "lfa list",
    "lfa validate FILE", "lfa schema", "lfa completion bash", "lfa sim SCENARIO --seed 7", "lfa --version",
    "lfa why RUN", "lfa diff A B",
)  # fmt: skip
ON_A_FLEET = (
    "lfa watch",
    "lfa topic",
    "lfa formation column",
    "lfa stop",
    "lfa resume",
    "lfa pause",
    "lfa set cruise_mps=0.3",
    "lfa go 3 -1.5",
    "lfa home",
    "lfa fault kill leader",
)
ELSEWHERE = {
    "lfa run SCENARIO": "tests/processes/test_run.py",
    "lfa run paper_path1 --fault 'kill leader at 20 s'": "tests/processes/test_run.py",
    "lfa run paper_path1 --map-from RUN": "tests/deploy/analysis/paper/test_checks.py",
    **dict.fromkeys(
        ("lfa sim SCENARIO --seeds 1..100 --set a=1,2,3", "lfa campaign PLAN", "lfa campaign merge DIR..."),
        "tests/deploy/campaign/test_docs_page.py",
    ),
    **dict.fromkeys(("lfa run SCENARIO --lockstep", "lfa step 50"), "tests/processes/test_lockstep.py"),
    "lfa teleop": "tests/deploy/operate/test_orders_team.py",
    "lfa forget 3": "tests/protocol/lease/test_forget.py",
    **dict.fromkeys(("lfa join 7", "lfa retire 3"), "tests/processes/test_roster.py"),
    "lfa fuzz [--whole] [--lagging] [--stops]": "tests/deploy/fuzz/test_agent_simulation.py",
    "lfa map RUN --out DIR": "tests/deploy/scenarios/test_explore.py",
    "lfa view RUN": "tests/deploy/view/rerun/test_view.py",
    "lfa view": "tests/deploy/view/test_bad_input.py",
    "lfa metrics": "tests/processes/test_metrics.py",
    "lfa web": "tests/deploy/web/test_page.py",
    "lfa web RUN": "tests/deploy/web/test_recording.py",
    "lfa web SCENARIO": "tests/deploy/web/test_server.py",
    "lfa record": "tests/processes/test_looking.py",
    "lfa bench control --jobs 2": "tests/deploy/bench/test_control.py",
    "lfa-driver --id 3": "tests/processes/test_driver.py",
    "lfa ros --serve": "tests/processes/test_ros_bridge.py",
    "lfa foxglove": "tests/processes/test_foxglove.py",
    "lfa bag RUN": "tests/deploy/ros/test_bag.py",
    "lfa doctor": "tests/hosts/test_refused.py",
    "lfa upgrade FILE": "tests/deploy/fleet/test_upgrade.py",
    "lfa up FILE --secure": "tests/deploy/fleet/security/test_secure.py",
    "lfa export compose FILE": "tests/deploy/fleet/export/test_export.py",
    "lfa import FILE": "tests/deploy/worlds/test_import.py",
    "lfa export sdf SCENARIO": "tests/deploy/worlds/test_import.py",
    "lfa keys revoke FILE robot3": "tests/deploy/fleet/security/test_secure.py",
    "lfa sim circle --controller carrot": "tests/agents/controllers/test_plug_in.py",
    **dict.fromkeys(
        ("lfa sim straight --behavior deploy/examples/12_own_behavior.py:Cautious",
         "lfa sim straight --sensor deploy/examples/10_own_sensor.py:Light",
         "lfa sim deploy/examples/09_own_generator.py:Slalom --seed 3"),
        "tests/deploy/test_own_code.py",
    ),
    "lfa doctor FILE": "tests/hosts/test_refused.py",
    "lfa-agent": "tests/first_hour/test_hour.py",
    **dict.fromkeys(
        ("lfa up FILE", "lfa up", "lfa up deploy/fleet.example.toml", "lfa ps", "lfa top", "lfa logs",
         "lfa logs -f robot3", "lfa restart", "lfa restart 3", "lfa down"),
        "tests/deploy/fleet/test_local.py",
    ),
    **dict.fromkeys(
        ("lfa-router", "lfa-world paper_path1", "lfa-agent --role leader --id 1", "lfa-agent --role follower --id 2",
         "lfa-agent --role follower --id 3", "lfa-agent --role follower --id 4"),
        "tests/processes/test_by_hand.py",
    ),
}  # fmt: skip
"""Commands that a test of their own runs, with everything they need."""


def printed() -> set[str]:
    """The commands in backticks and in blocks without a language; several machines' lines are not for one machine."""
    blocks = [block for block in re.findall(r"```\n(.*?)```", README, re.DOTALL) if "machine a:" not in block]
    lines = [
        part.partition("#")[0].strip() for block in blocks for line in block.splitlines() for part in line.split(";")
    ]
    quoted = re.findall(r"`(lfa[ -][^`]+)`", re.sub(r"```.*?```", "", README, flags=re.DOTALL))
    commands = (text for text in [*lines, *quoted] if re.match(r"lfa(-\w+)?( |$)", text) and "=" not in text.split()[0])
    return {text for text in commands if text not in ("lfa sim", "lfa run")}


@pytest.fixture(scope="module")
def run_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("readme") / "run"
    done = lfa(
        "sim",
        "straight",
        "--seed",
        "7",
        "--set",
        "mission.leading.route_m=[[1.0, 0.0]]",
        "--no-figures",
        "--out",
        str(folder),
    )
    assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    with running(tmp_path_factory.mktemp("fleet") / "run", "straight", "--set", "time_limit_s=60.0") as run:
        run.wait_for("leader_command")
        yield run


def test_no_command_is_printed_that_nothing_runs() -> None:
    known = {*ON_A_RUN, *ON_A_FLEET, *ELSEWHERE}
    assert printed() - known == set(), "add them to the tables of this file"
    assert {path for path in ELSEWHERE.values() if not (ROOT / path).is_file()} == set()


@pytest.mark.parametrize("command", ON_A_RUN)
def test_a_command_on_a_run_works_as_printed(command: str, run_folder: Path, tmp_path: Path) -> None:
    words = shlex.split(command)[1:]
    stands_for = {"RUN": run_folder, "RUN...": run_folder, "A": run_folder, "B": run_folder, "SCENARIO": "straight"}
    stands_for["FILE"] = run_folder / "scenario.toml"
    more = ("--out", str(tmp_path / "run"), "--no-figures") if words[0] == "sim" else ()
    done = lfa(*(str(stands_for.get(word, word)) for word in words), *more)
    assert done.returncode == 0, f"{command}\n{done.stdout}{done.stderr}"


@pytest.mark.parametrize("command", ON_A_FLEET)
def test_a_command_on_a_running_fleet_works_as_printed(command: str, fleet: Running) -> None:
    words = shlex.split(command)[1:]
    more = {"watch": ("--once",), "topic": ("list", "--seconds", "1")}.get(words[0], ())
    router = fleet.group()["router"].arguments[-1]
    where = ("--fleet", f"straight-{fleet.launcher.pid}", *(() if words[0] == "fault" else ("--connect", router)))
    done = lfa(*words, *more, *where)
    assert done.returncode == 0, f"{command}\n{done.stdout}{done.stderr}"


@pytest.mark.parametrize("target", sorted(set(re.findall(r"(?:^|`)make ([\w-]+)", README, re.MULTILINE))))
def test_every_make_target_of_the_readme_exists(target: str) -> None:
    assert re.search(rf"^{target}:", MAKEFILE, re.MULTILINE)
