"""A whole Slurm on this machine: munge, controller and one node, from Debian's packages, in a folder of their own."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

NEEDED = ("munged", "slurmctld", "slurmd", "sbatch", "sinfo")
READY_S_MAX = 30.0
END_S_MAX = 10.0
KEY_BYTES = 128


def missing() -> str:
    """Why no Slurm can be started here; empty if one can."""
    absent = [name for name in NEEDED if shutil.which(name, path=f"{os.environ['PATH']}:/usr/sbin") is None]
    if absent:
        return f"{', '.join(absent)} not installed: apt-get install slurm-wlm munge"
    return "" if os.geteuid() == 0 else "a node that starts jobs needs root"


@contextmanager
def slurm(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Run a cluster of one node, named like this machine; `SLURM_CONF` names its configuration. Yields its log folder.

    `folder` must be short, for sockets, and every user must be allowed to pass it.
    """
    socket_path = folder / "munge.socket"
    name, (controller, node) = socket.gethostname().partition(".")[0], _free_ports()
    conf = folder / "slurm.conf"
    conf.write_text(
        f"""ClusterName=lfa
SlurmctldHost={name}(127.0.0.1)
SlurmUser=root
SlurmctldPort={controller}
SlurmdPort={node}
AuthType=auth/munge
AuthInfo=socket={socket_path}
CredType=cred/munge
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
MpiDefault=none
ReturnToService=2
SchedulerType=sched/builtin
SchedulerParameters=batch_sched_delay=0,sched_interval=1
SelectType=select/cons_tres
NodeName={name} NodeAddr=127.0.0.1 CPUs={os.cpu_count()} State=UNKNOWN
PartitionName=all Nodes={name} Default=YES MaxTime=10 State=UP
"""
    )
    key = folder / "munge.key"
    key.write_bytes(os.urandom(KEY_BYTES))
    key.chmod(0o400)
    for inner in ("state", "spool"):
        (folder / inner).mkdir()
    monkeypatch.setenv("SLURM_CONF", str(conf))
    monkeypatch.setenv("PATH", f"{os.environ['PATH']}:/usr/sbin")
    files = {"socket": socket_path, "key-file": key, "seed-file": folder / "munge.seed"}
    files |= {f"{kind}-file": folder / f"munged.{kind}" for kind in ("log", "pid")}
    munged = ("munged", "--foreground", "--force", *(f"--{what}={path}" for what, path in files.items()))
    with ExitStack() as stack:
        for words in (munged, ("slurmctld", "-D", "-f", str(conf)), ("slurmd", "-D", "-N", name, "-f", str(conf))):
            stack.enter_context(_running(words, folder / f"{words[0]}.out"))
            if words is munged:
                _wait(socket_path.exists, folder)
        _wait(lambda: _said("sinfo", "--noheader", "--format=%T") == "idle", folder)
        yield folder


@contextmanager
def _running(words: tuple[str, ...], log: Path) -> Iterator[None]:
    with log.open("wb") as out:
        process = subprocess.Popen(words, stdin=subprocess.DEVNULL, stdout=out, stderr=subprocess.STDOUT)
    try:
        yield
    finally:
        process.terminate()
        try:
            process.wait(END_S_MAX)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def _said(*words: str) -> str:
    done = subprocess.run(words, capture_output=True, text=True, timeout=READY_S_MAX, check=False)
    return done.stdout.strip()


def _wait(holds, folder: Path) -> None:  # type: ignore[no-untyped-def]
    until = time.monotonic() + READY_S_MAX
    while not holds():
        if time.monotonic() > until:
            logs = "\n".join(f"{path.name}: {path.read_text()[-600:]}" for path in sorted(folder.glob("*.out")))
            raise TimeoutError(f"no cluster after {READY_S_MAX} s\n{logs}")
        time.sleep(0.1)


def _free_ports() -> tuple[int, int]:
    with socket.socket() as one, socket.socket() as other:
        one.bind(("127.0.0.1", 0))
        other.bind(("127.0.0.1", 0))
        return one.getsockname()[1], other.getsockname()[1]
