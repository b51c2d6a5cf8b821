"""Executors that take the shares of a campaign: `slurm` and `dask://HOST:PORT`."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol

from lfa.deploy.campaign.engines.share_command import run_share
from lfa.protocol.errors import Refused

DASK = "dask://"
DASK_WAIT_S = 20.0
SLURM_LOGS = "slurm"
"""Folder of submitit's files, in the folder of the campaign."""


class Handle(Protocol):
    """Share that an engine has taken: the part of a `concurrent.futures.Future` that all of them have."""

    def done(self) -> bool: ...

    def result(self) -> Any: ...


@contextmanager
def on_dask(address: str, commands: Sequence[list[str]]) -> Iterator[list[Handle]]:
    """Submit the shares to the Dask scheduler at `address` (`dask://HOST:PORT`). Raises Refused if none answers."""
    if not re.fullmatch(r"dask://[\w.\-]+:\d+", address):
        raise Refused(f"--on {address}: must be dask://HOST:PORT")
    from distributed import Client

    try:
        make: Any = Client  # without types
        client = make(f"tcp://{address.removeprefix(DASK)}", timeout=DASK_WAIT_S, set_as_default=False)
    except (OSError, ValueError) as error:
        raise Refused(f"--on {address}: no Dask scheduler answers ({error}): must be dask://HOST:PORT") from None
    with client:
        yield [client.submit(run_share, words, pure=False) for words in commands]


@contextmanager
def on_submitit(
    folder: Path, commands: Sequence[list[str]], cluster: str, minutes: int, cpus: int, options: Mapping[str, str]
) -> Iterator[list[Handle]]:
    """Submit the shares by submitit as one array; `cluster` is `slurm`, or `local` for processes of this machine.

    `options` are further ones of sbatch, such as `partition`. Raises Refused where Slurm does not take them.
    """
    import submitit

    try:
        executor = submitit.AutoExecutor(folder / SLURM_LOGS, cluster=cluster)
        executor.update_parameters(name="lfa", timeout_min=minutes, cpus_per_task=cpus)
        executor.update_parameters(**{f"slurm_{key}": value for key, value in options.items()})
        with executor.batch():
            jobs = [executor.submit(run_share, words) for words in commands]
    except (RuntimeError, ValueError, TypeError, submitit.core.utils.FailedJobError) as error:
        raise Refused(f"--on {cluster}: does not take the shares: {' '.join(str(error).split())}") from None
    try:
        yield list(jobs)
    except BaseException:
        for job in jobs:
            job.cancel()
        raise
