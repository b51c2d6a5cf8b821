"""`lfa-world`: bad input is one line on stderr and exit code 2, before anything is started."""

from __future__ import annotations

import subprocess
import sys

import pytest

from lfa.world import cli


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["paper_pth1"], "no scenario 'paper_pth1': did you mean 'paper_path1'?"),
        (["straight", "--robots", "0"], "--robots 0: mission.robots = []: must be at least one robot id"),
        (["straight", "--set", "world.body.mass_kg=-1"], "world.body.mass_kg = -1"),
        (["straight", "--fleet", "a/b"], "--fleet 'a/b'"),
        (["straight", "--seed", "x"], "--seed"),
        (["straight", "--sed", "1"], "--sed"),
        ([], "scenario"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(
    arguments: list[str], says: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["lfa-world", *arguments])
    with pytest.raises(SystemExit) as ended:
        cli.main()
    printed = capsys.readouterr()
    assert ended.value.code == 2
    assert printed.out == ""
    assert printed.err.startswith("lfa-world: ")
    assert printed.err.count("\n") == 1
    assert says in printed.err


@pytest.mark.parametrize("module", ["numpy", "pymunk"])
def test_a_missing_extra_is_named_with_the_command_that_installs_it(module: str) -> None:
    code = f"import sys; sys.modules[{module!r}] = None; from lfa.world.cli import main; main()"
    done = subprocess.run([sys.executable, "-c", code, "straight"], capture_output=True, text=True, timeout=60)
    assert done.returncode == 2
    assert done.stderr == f"lfa-world: needs {module}: install with: pip install 'lfa[world]'\n"
