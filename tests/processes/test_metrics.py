"""`lfa metrics` beside a fleet of real processes."""

from __future__ import annotations

import signal
import subprocess
from pathlib import Path
from socket import create_server
from urllib.error import HTTPError
from urllib.request import urlopen

import pytest
from prometheus_client.openmetrics.parser import text_string_to_metric_families

from tests.rigs.lfa_runs import LFA, eventually, lfa, running

pytestmark = pytest.mark.processes


def free_port() -> int:
    with create_server(("127.0.0.1", 0)) as server:
        port: int = server.getsockname()[1]
        return port


def test_a_scrape_on_localhost_shows_who_leads(tmp_path: Path) -> None:
    with running(tmp_path / "run", "straight", "--robots", "2") as run:
        run.wait_for("leader_command")
        fleet = ("--fleet", f"straight-{run.launcher.pid}")
        where = f"127.0.0.1:{free_port()}"
        command = [*LFA, "metrics", *fleet, "--listen", where]
        server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        try:
            assert server.stdout is not None
            assert where in server.stdout.readline()
            eventually(lambda: leaders(where) == ["robot1"], "no scrape shows the leader")
            with pytest.raises(HTTPError):
                urlopen(f"http://{where}/etc/passwd")
            taken = lfa("metrics", *fleet, "--listen", where)
            assert (taken.returncode, len(taken.stderr.splitlines())) == (2, 1)
        finally:
            server.send_signal(signal.SIGTERM)
            assert server.wait(10) == 0


def leaders(where: str) -> list[str]:
    with urlopen(f"http://{where}/metrics") as answer:
        assert answer.headers["Content-Type"].startswith("application/openmetrics-text")
        text = answer.read().decode()
    samples = [
        s for family in text_string_to_metric_families(text) for s in family.samples if family.name == "lfa_role"
    ]
    return [s.labels["robot"] for s in samples if s.value and s.labels["role"] == "leader"]
