"""What lies in a machine's state folder is this user's own: nobody else can put a socket, a plan or a ledger there."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import msgspec
import pytest

from lfa.deploy.fleet.engine.engine import KnownProcess
from lfa.deploy.fleet.host.end import end
from lfa.deploy.fleet.host.ledger import LEDGER, Ledger, ledger
from lfa.deploy.fleet.host.start_check import check_place
from lfa.deploy.fleet.plan.fleet_file import load
from lfa.deploy.fleet.plan.host_plan import parts
from lfa.deploy.process.identity import identify
from lfa.protocol.errors import Refused


def test_a_state_folder_that_another_user_could_put_in_place_of_ours_is_refused(tmp_path: Path) -> None:
    """Its router's socket would be theirs, and whoever connects there their agents."""
    shared = tmp_path / "shared"
    shared.mkdir()
    file = tmp_path / "fleet.toml"
    file.write_text(f'scenario = "straight"\n[hosts.here]\nstate = "{shared}/state"\n')
    part = parts(load(file), "", "")["here"]
    check_place(part)
    shared.chmod(0o1777)
    check_place(part)
    shared.chmod(0o777)
    with pytest.raises(Refused, match=r"shared is of user .*, mode 0777: must be in a folder in which nobody else"):
        check_place(part)
    (shared / "state").mkdir(mode=0o700)
    with pytest.raises(Refused, match=r"shared is of user .*, mode 0777: must be in a folder in which nobody else"):
        check_place(part)


def test_a_ledger_of_another_user_names_no_process_to_be_ended(tmp_path: Path) -> None:
    if os.geteuid() != 0:
        pytest.skip("giving a file to another user needs root")
    sleeper = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
    try:
        known = identify(sleeper.pid)
        assert known is not None
        book = Ledger("run", "digest", known, (KnownProcess("robot1", known, 1, 0),))
        (tmp_path / LEDGER).write_bytes(msgspec.json.encode(book))
        assert ledger(tmp_path) == book
        os.chown(tmp_path / LEDGER, 65534, 65534)
        assert end(tmp_path) is None
        assert sleeper.poll() is None
    finally:
        sleeper.communicate(b"\n")
