"""What a machine answers is found whatever its shell prints, and what is wrong is named rightly."""

from __future__ import annotations

import asyncio
import os
import stat
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

from lfa.deploy.fleet.plan.fleet_file import Machine, load
from lfa.deploy.fleet.plan.host_plan import parts
from lfa.deploy.fleet.remote import wheel
from lfa.deploy.fleet.remote.hosts import ask
from lfa.deploy.fleet.remote.ssh import Done, Here, probe
from lfa.protocol.errors import Refused

SHADOWS = ("random.py", "json.py", "world.py", "agents.py", "lfa.py", "msgspec.py", "tempfile.py")


class Greeting(Here):
    """Shell that prints a greeting before it runs a command, in a folder of the user's own modules."""

    def __init__(self, greeting: bytes, instead: bool = False) -> None:
        self._greeting = greeting
        self._instead = instead

    async def run(self, words: Sequence[str], stdin: bytes = b"") -> Done:
        done = Done(0, b"", b"") if self._instead else await super().run(words, stdin)
        return Done(done.code, self._greeting + done.out, done.err)


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working folder, with modules of the user's own whose names are taken."""
    home = tmp_path / "home"
    home.mkdir()
    for name in SHADOWS:
        (home / name).write_text("raise SystemExit('shadowed')\n")
    monkeypatch.chdir(home)
    return home


@pytest.mark.parametrize("greeting", [b"Hello from robot b, ROS_DOMAIN_ID=7\n", b"{} \xff no newline", b""])
def test_a_greeting_and_modules_in_the_home_folder_do_no_harm(greeting: bytes, home: Path) -> None:
    found = asyncio.run(probe(Greeting(greeting), sys.executable))
    assert found.python == sys.version_info[:3]


def test_a_check_is_answered_from_a_folder_of_shadows(home: Path) -> None:
    file = home / "fleet.toml"
    file.write_text(f'scenario = "straight"\n[hosts.here]\nstate = "{home / "state"}"\n')
    plan = load(file)
    found = asyncio.run(ask(Greeting(b"Hello\n"), Machine(python=sys.executable), "check", parts(plan, "", "")["here"]))
    assert found.run == ""


def test_a_shell_that_runs_no_command_is_named_and_not_its_python() -> None:
    with pytest.raises(Refused, match="prints 'This account is closed' and no answer: make its shell silent"):
        asyncio.run(probe(Greeting(b"This account is closed\n", instead=True), sys.executable))


def test_a_wheel_is_installed_from_a_new_folder_that_is_gone_afterwards(
    home: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The place is not to be guessed: another user could write a wheel there before."""
    shared, seen = tmp_path / "shared", tmp_path / "seen"
    shared.mkdir(mode=0o777)
    monkeypatch.setenv("TMPDIR", str(shared))
    look = "import os, sys\npath = sys.argv[-1]\nmode = os.stat(os.path.dirname(path)).st_mode\n"
    look += f"open({str(seen)!r}, 'w').write(f'{{path}} {{mode:o}}')\n"
    pip = tmp_path / "modules" / "pip"
    pip.mkdir(parents=True)
    (pip / "__init__.py").touch()
    (pip / "__main__.py").write_text(look)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path / "modules"))
    done = subprocess.run(
        [sys.executable, "-P", "-c", wheel.INSTALL, "lfa.whl", "", "--no-deps"], input=b"x", check=False
    )
    assert done.returncode == 0
    path, mode = seen.read_text().split()
    assert Path(path).name == "lfa.whl" and Path(path).parent.parent == shared
    assert stat.S_IMODE(int(mode, 8)) == 0o700
    assert list(shared.iterdir()) == []


def test_a_virtual_environment_is_made_whatever_lies_in_the_home_folder(home: Path, tmp_path: Path) -> None:
    (home / "venv.py").write_text("raise SystemExit('the module of another')")
    done = asyncio.run(Here().run((*wheel.MAKE_VENV, "--without-pip", str(tmp_path / "made"))))
    assert (done.code, done.err) == (0, b"")
    assert (tmp_path / "made" / "bin" / "python").exists()


def test_routers_of_machines_with_ipv6_addresses_listen_in_ipv6(tmp_path: Path) -> None:
    file = tmp_path / "fleet.toml"
    text = 'scenario = "straight"\n[hosts.a]\naddress = "fd00:77::2"\n[hosts.b]\naddress = "10.0.0.3"\n'
    file.write_text(f'{text}[links]\ntransport = "tcp"\n')
    made = parts(load(file), "", "")
    assert made["a"].listen == ("tcp/[::]:7447",)
    assert made["b"].listen == ("tcp/0.0.0.0:7447",)
    assert made["b"].connect == ("tcp/[fd00:77::2]:7447",)
    file.write_text(text)
    with pytest.raises(Refused, match=r"hosts.a.address = fd00:77::2: must be an address of IPv4, or"):
        load(file)


def test_a_state_folder_of_another_user_is_refused(tmp_path: Path) -> None:
    if os.geteuid() != 0:
        pytest.skip("giving a folder to another user needs root")
    state = tmp_path / "state"
    state.mkdir()
    os.chown(state, 65534, 65534)
    file = tmp_path / "fleet.toml"
    file.write_text(f'scenario = "straight"\n[hosts.here]\nstate = "{state}"\n')
    part = parts(load(file), "", "")["here"]
    with pytest.raises(Refused, match="of user 65534, mode 0755: must be your own folder"):
        asyncio.run(ask(Here(), Machine(python=sys.executable), "check", part))
