"""`lfa` itself: a table of commands that answers quickly, and what a shell completes."""

from __future__ import annotations

import shutil
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest

from lfa.deploy import completion
from lfa.deploy.cli import COMMANDS, overview
from lfa.deploy.command_line import command_app, run_cli
from lfa.deploy.whole_output import whole_file
from lfa.world.description.load import shipped

LFA = (sys.executable, "-c", "from lfa.deploy.cli import main; main()")


def test_help_names_every_command() -> None:
    told = subprocess.run([*LFA, "--help"], capture_output=True, text=True, check=True).stdout
    assert told == overview() + "\n"
    assert [entry.name for entry in COMMANDS if f"  {entry.name} " not in told] == []


@pytest.mark.parametrize(("asked", "begins"), [("-h", "Usage: lfa COMMAND"), ("--version", f"lfa {version('lfa')}")])
def test_the_habits_of_other_programs_are_answered(asked: str, begins: str) -> None:
    assert subprocess.run([*LFA, asked], capture_output=True, text=True, check=True).stdout.startswith(begins)


def test_a_path_that_nothing_can_have_is_refused_in_one_line() -> None:
    done = subprocess.run([*LFA, "replay", "n" * 300], capture_output=True, text=True, timeout=60)
    assert done.returncode == 2
    assert done.stderr.startswith(f"lfa: {'n' * 300}")
    assert done.stderr.endswith("File name too long: must be the path of a file or a folder\n")
    assert done.stderr.count("\n") == 1


def test_a_file_in_a_folder_that_is_not_there_is_refused_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """As by `lfa view RUN --html none/clip.html`."""

    def write() -> None:
        with whole_file(tmp_path / "none/clip.html") as fresh:
            fresh.write_text("")

    monkeypatch.setattr("sys.argv", ["lfa"])
    assert run_cli("lfa", command_app(write, "", "")) == 2
    right = "No such file or directory: must be the path of a file or a folder"
    assert capsys.readouterr().err == f"lfa: {tmp_path}/none/clip.html: {right}\n"


@pytest.mark.parametrize("asked", ["--help", "--version", "list"])
def test_a_full_disk_behind_the_output_is_one_line(asked: str) -> None:
    with open("/dev/full", "w") as full:
        done = subprocess.run([*LFA, asked], stdout=full, stderr=subprocess.PIPE, text=True, timeout=60, check=False)
    assert (done.returncode, done.stderr.count("\n")) == (1, 1), done.stderr
    assert "No space left on device" in done.stderr


def test_help_does_not_wait_for_the_parser() -> None:
    code = "import sys; from lfa.deploy import cli; cli.overview(); print('typer' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout == "False\n"


def _completed(script: Path, *typed: str) -> list[str]:
    """What bash offers for the last of the words."""
    ask = f"source {script}; COMP_WORDS=({' '.join(typed)}); COMP_CWORD={len(typed) - 1}; _lfa; echo ${{COMPREPLY[@]}}"
    return subprocess.run(["bash", "-c", ask], capture_output=True, text=True, check=True).stdout.split()


@pytest.fixture(scope="module")
def script(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("completion") / "lfa.bash"
    path.write_bytes(subprocess.run([*LFA, "completion", "bash"], capture_output=True, check=True).stdout)
    return path


@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash here")
def test_bash_completes_commands_options_scenarios_and_choices(script: Path) -> None:
    assert _completed(script, "lfa", "re") == ["restart", "resume", "retire", "record", "report", "replay"]
    assert _completed(script, "lfa", "sim", "--se") == ["--seed", "--seeds", "--set", "--sensor"]
    assert _completed(script, "lfa", "run", "paper_path") == [n for n in shipped() if n.startswith("paper_path")]
    assert _completed(script, "lfa", "topic", "e") == ["echo"]
    assert "--no-figures" in _completed(script, "lfa", "run", "--no")


def test_every_command_is_in_the_script_of_every_shell() -> None:
    rows = completion.words()
    assert all("--help" in row.options for row in rows)
    for make in (completion._bash, completion._zsh, completion._fish):
        assert [entry.name for entry in COMMANDS if entry.name not in make(rows)] == []
