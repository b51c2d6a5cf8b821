"""A plan's shares on the engines of others: the merged results are those of this machine."""

from __future__ import annotations

import shlex
import signal
import subprocess
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

import msgspec
import pytest
import yaml

from lfa.deploy.campaign.commands.campaign import command
from lfa.deploy.campaign.engines import dispatch
from lfa.deploy.campaign.engines.executors import SLURM_LOGS, on_submitit
from lfa.deploy.campaign.engines.kubernetes import manifest
from lfa.deploy.campaign.engines.share_command import run_share, share_commands
from lfa.deploy.campaign.folder import DESCRIPTION
from lfa.deploy.campaign.sweep.plan import read_plan
from lfa.deploy.campaign.sweep.runs import items_of
from lfa.protocol.errors import Refused
from tests.rigs import slurm_cluster

PLAN = """\
scenario = "straight"
title = "engines"
seeds = "1..3"
robots = 1
[set]
time_limit_s = 1
[assert]
goal_reached = false
left_behind_max = 1
"""
pytestmark = pytest.mark.processes


ENGINE_S_MAX = 240


@pytest.fixture(autouse=True)
def _bounded() -> Iterator[None]:
    """End a test whose engine never ends: a job that stays in a queue would be waited for."""

    def over(_signum: int, _frame: FrameType | None) -> None:
        raise TimeoutError(f"no end after {ENGINE_S_MAX} s")

    before = signal.signal(signal.SIGALRM, over)
    signal.alarm(ENGINE_S_MAX)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


@pytest.fixture
def plan(tmp_path: Path) -> Path:
    path = tmp_path / "plan.toml"
    path.write_text(PLAN)
    return path


def _is_whole(out: Path, plan: Path) -> bool:
    rows = (out / "merged" / "results.csv").read_text().splitlines()[1:]
    return [row.partition(",")[0] for row in rows] == [item.name for item in items_of(read_plan(plan))]


@pytest.mark.skipif(slurm_cluster.missing() != "", reason=slurm_cluster.missing() or "there is one")
def test_an_array_of_a_real_slurm_does_the_whole_plan(
    plan: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("submitit")
    with tempfile.TemporaryDirectory(prefix="slurm-") as place, slurm_cluster.slurm(Path(place), monkeypatch):
        out = plan.parent / "out"
        code = command([str(plan)], on="slurm", shards=2, minutes=5, slurm=["partition=all"], out=out)
        assert code == 0, capfd.readouterr().err
        assert _is_whole(out, plan)
        scripts = list((out / SLURM_LOGS).glob("*submission*.sh"))
        assert any("--array=0-1" in script.read_text() for script in scripts), "one array, not two jobs"


def test_submitits_local_executor_does_the_whole_plan(plan: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("submitit")

    def local(_on: str, folder: Path, commands: list[list[str]], minutes: int, jobs: int, options: Mapping[str, str]):  # type: ignore[no-untyped-def]
        return on_submitit(folder, commands, "local", minutes, jobs, options)

    monkeypatch.setattr("lfa.deploy.campaign.commands.sweep.engine", local)
    assert command([str(plan)], on="slurm", shards=2, out=plan.parent / "out") == 0
    assert _is_whole(plan.parent / "out", plan)


@contextmanager
def _dask() -> Iterator[str]:
    from distributed import LocalCluster

    with LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster:
        yield cluster.scheduler_address.removeprefix("tcp://")


def test_a_dask_cluster_of_two_does_the_whole_plan(plan: Path) -> None:
    pytest.importorskip("distributed")
    with _dask() as address:
        assert command([str(plan)], on=f"dask://{address}", shards=2, out=plan.parent / "out") == 0
    assert _is_whole(plan.parent / "out", plan)


def test_a_share_of_another_version_does_nothing_and_says_so(plan: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert command([str(plan)], shard="1/3", out=out) == 0
    described = msgspec.json.decode((out / DESCRIPTION).read_bytes())
    (out / DESCRIPTION).write_bytes(msgspec.json.encode({**described, "lfa": "lfa 9.9.9 (code 0)"}))
    before = sorted((out / "results").iterdir())
    code, said = run_share(share_commands(plan, out, 3, 1)[1])
    assert code == 2
    assert "of lfa 9.9.9 (code 0), and this is lfa" in said
    assert sorted((out / "results").iterdir()) == before


class _Ended:
    """A share that ended with this exit code and this error text."""

    def __init__(self, code: int, said: str) -> None:
        self._value = code, said

    def done(self) -> bool:
        return True

    def result(self) -> tuple[int, str]:
        return self._value


def test_a_share_that_did_not_do_its_work_is_named(plan: Path, capfd: pytest.CaptureFixture[str]) -> None:
    from lfa.deploy.campaign.folder import open_folder
    from lfa.deploy.campaign.sweep.runs import describe

    read = read_plan(plan)
    kept = open_folder(plan.parent / "out", describe(read, items_of(read)))
    assert dispatch.watch([_Ended(1, "failed: one"), _Ended(2, "lfa: of another version"), _Ended(137, "")], kept) == 2
    said = capfd.readouterr().err
    assert "share 2: exit code 2: lfa: of another version" in said
    assert "share 3: exit code 137: no message" in said


# --- kubernetes -----------------------------------------------------------------------------------------------------


def test_an_indexed_job_does_each_share_of_the_plan_once(plan: Path, tmp_path: Path) -> None:
    config, job = yaml.safe_load_all(manifest(plan, shares=3, jobs=2))
    assert config["data"]["plan.toml"] == PLAN
    assert job["spec"]["completionMode"] == "Indexed"
    assert job["spec"]["completions"] == 3
    shell, flag, script = job["spec"]["template"]["spec"]["containers"][0]["command"]
    printed = script.replace("exec lfa", "printf '%s\\n'")
    for index in range(3):
        done = subprocess.run(
            [shell, flag, printed], env={"JOB_COMPLETION_INDEX": str(index), "PATH": "/usr/bin:/bin"},
            capture_output=True, text=True, check=True,
        )  # fmt: skip
        words = done.stdout.split()
        assert words == shlex.split(f"campaign /plan/plan.toml --shard {index + 1}/3 --jobs 2 --out /results/plan")


# --- bad input ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"on": "lsf"}, "--on lsf: must be one of local, slurm, dask://HOST:PORT, kubernetes"),
        ({"on": "slurm", "shard": "1/2"}, "--on slurm with --shard 1/2: must be one of the two"),
        ({"on": "slurm", "shards": 0}, "each must be at least 1"),
        ({"on": "slurm", "slurm": ["partition"]}, "--slurm partition: must be like partition=short"),
        ({"on": "dask://nowhere"}, "--on dask://nowhere: must be dask://HOST:PORT"),
    ],
)
def test_an_engine_that_is_none_is_refused(plan: Path, options: dict[str, object], says: str) -> None:
    with pytest.raises(Refused, match=says.replace("(", r"\(")):
        command([str(plan)], out=plan.parent / "out", **options)  # type: ignore[arg-type]


def test_a_missing_slurm_is_one_line(plan: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("submitit")
    monkeypatch.setenv("PATH", "/nowhere")
    with pytest.raises(Refused, match="--on slurm: does not take the shares"):
        command([str(plan)], on="slurm", out=plan.parent / "out")
