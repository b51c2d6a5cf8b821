"""`lfa.deploy.process.worker_pool`: nothing of a campaign outlives it."""

from __future__ import annotations

import os
import select
import signal
import subprocess
import sys
from pathlib import Path

import pytest

WITHIN_MS = 20_000
CAMPAIGN = """
import os, sys, tempfile, time
from lfa.deploy import cli
from lfa.deploy.process.worker_pool import workers

def campaign() -> None:
    with workers(1) as pool:
        print(pool.submit(os.getpid).result(), pool.submit(tempfile.mkdtemp).result(), flush=True)
        pool.submit(time.sleep, 600.0).result()

if __name__ == "__main__":
    cli.build = lambda _called: None
    cli.run_cli = lambda *_: campaign()
    sys.argv[1:] = ["campaign"]
    cli.main()
"""


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGKILL])
def test_a_campaign_that_is_ended_leaves_no_worker(number: signal.Signals, tmp_path: Path) -> None:
    script = tmp_path / "campaign.py"
    script.write_text(CAMPAIGN)
    with subprocess.Popen([sys.executable, str(script)], stdout=subprocess.PIPE, text=True) as launcher:
        assert launcher.stdout is not None
        worker, place = launcher.stdout.readline().split()
        ends = select.poll()
        ends.register(os.pidfd_open(int(worker)))
        launcher.send_signal(number)
    assert ends.poll(WITHIN_MS), f"worker {worker} outlives a campaign that {number.name} has ended"
    assert number is signal.SIGKILL or not Path(place).exists()
