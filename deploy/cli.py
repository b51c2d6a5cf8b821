"""`lfa`: a table of commands. The module of a command is imported when it is called, so `lfa --help` stays quick.

Every command module has a function `command`. Bad input, ours or the parser's, is one line on stderr and exit code 2.
"""

from __future__ import annotations

import errno
import io
import os
import signal
import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    import typer


class Entry(NamedTuple):
    name: str
    module: str
    help: str
    example: str


COMMANDS = (
    Entry("run", "deploy.run.launch", "Start router, world and agents as processes here; write a run folder.",
          "lfa run paper_path1 --robots 4 --fault 'kill leader at 20 s'"),
    Entry("sim", "deploy.run.simulate", "The same in one process, in virtual time; the same run folder.",
          "lfa sim paper_path1 --seed 7 --set world.lidar.beams=90"),
    Entry("fuzz", "deploy.run.fuzz", "Hunt for schedules of faults that break the lease protocol.",
          "lfa fuzz --seeds 1000 --jobs 2; lfa fuzz --seed 147 -v; lfa fuzz --whole"),
    Entry("up", "deploy.fleet.up", "Bring a fleet up on its machines, over ssh, and wait until all of it drives.",
          "lfa up deploy/fleet.example.toml"),
    Entry("ps", "deploy.fleet.ps", "What runs on which machine of a fleet.",
          "lfa ps --json"),
    Entry("top", "deploy.fleet.top", "A fleet's machines and robots on one screen, live.",
          "lfa top"),
    Entry("logs", "deploy.fleet.logs", "The log of one process of a fleet, or of all, wherever it runs.",
          "lfa logs -f robot3"),
    Entry("restart", "deploy.fleet.restart", "End one process of a fleet and start it again, wherever it runs.",
          "lfa restart robot3"),
    Entry("doctor", "deploy.fleet.doctor", "What keeps a fleet's machines, or this one, from running.",
          "lfa doctor deploy/fleet.example.toml"),
    Entry("down", "deploy.fleet.down", "End a fleet on all its machines.",
          "lfa down"),
    Entry("fault", "deploy.run.inject", "Do something to a robot of a running fleet.",
          "lfa fault kill leader; lfa fault stop world; lfa fault restart 3; lfa fault cut 1>2"),
    Entry("forget", "deploy.run.forget", "Robots lost for good: a fleet without memory waits for them no more.",
          "lfa forget 3"),
    Entry("formation", "deploy.run.formation", "Ask the leader of a running fleet for another formation.",
          "lfa formation column"),
    Entry("watch", "deploy.look.watch", "How a running fleet stands, live on the terminal; keys do things to it.",
          "lfa watch --once"),
    Entry("view", "deploy.look.view", "A recording or a running fleet in the rerun viewer, a browser, or a picture.",
          "lfa view runs/paper_path1-20260101-120000 --screenshot run.png"),
    Entry("record", "deploy.run.onlook", "Record a fleet that runs already.",
          "lfa record --seconds 60"),
    Entry("topic", "deploy.look.topic", "What travels in a running fleet: list, echo, hz.",
          "lfa topic echo robot2/pose --count 1"),
    Entry("list", "deploy.look.scenarios", "The shipped scenarios.",
          "lfa list --json"),
    Entry("validate", "deploy.look.validate", "Check a scenario file, and say what a seed makes of it.",
          "lfa validate my_course.toml --set mission.leading.cruise_mps=0.3"),
    Entry("schema", "deploy.look.schema", "Every key of a scenario: JSON schema for editors, or a table.",
          "lfa schema --markdown"),
    Entry("plot", "deploy.look.plots", "Draw the figures of a run folder.",
          "lfa plot runs/paper_path1-20260101-120000"),
    Entry("report", "deploy.look.report", "One HTML page about a run, or about two side by side.",
          "lfa report runs/paper_path1-20260101-120000"),
    Entry("replay", "deploy.look.replay", "Run cores again on their journals and compare; or play a recording back.",
          "lfa replay runs/paper_path1-20260101-120000 --robot 2"),
    Entry("verify", "deploy.shapes.command", "Check runs: the lease's invariants, the shapes of the paper's figures.",
          "lfa verify runs/paper_path1-20260101-120000 runs/paper_path2-20260101-120100"),
    Entry("map", "deploy.look.mapped", "What an explorer came to know, as a ROS map.yaml and pgm.",
          "lfa map runs/explore-20260101-120000 --out maps"),
    Entry("keys", "deploy.fleet.keyring", "A fleet's certificates, and who may say what: init, rotate, revoke, show.",
          "lfa keys init keys --robots 12 --hosts a=10.0.0.1,b=10.0.0.2; lfa keys revoke keys robot3"),
    Entry("bench", "deploy.bench.command", "Measure, beside the bar to be reached.",
          "lfa bench lidar --json"),
    Entry("completion", "deploy.completion", "Print a script that completes commands and options in your shell.",
          "lfa completion bash > ~/.local/share/bash-completion/completions/lfa"),
)  # fmt: skip


EXTRAS = {
    "numpy": "world", "PIL": "world", "pymunk": "world", "matplotlib": "view", "mcap": "view", "rerun": "view",
    "zstandard": "view", "rich": "deploy", "asyncssh": "deploy", "cryptography": "deploy",
}  # fmt: skip
"""What is not in the base install, by the extra that brings it."""


DISK = (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EACCES, errno.EPERM, errno.EIO, errno.EISDIR, errno.ENOTDIR)
"""What a disk refuses in the midst of work: no fault of the program."""

NAMES = (errno.ENAMETOOLONG, errno.ELOOP)
"""What nothing can be called, whoever asks for it."""


def main() -> None:
    """The `lfa` script. Exit codes: 0 ok, 1 a run or an assertion failed, 2 bad input, 130 and 143 on signals."""
    if sys.argv[1:] == ["--version"]:
        from importlib.metadata import version

        print("lfa", version("lfa"))
        sys.exit(0)
    if sys.argv[1:] in ([], ["-h"], ["--help"]):  # answered before the parser is imported, which takes the longest
        print(overview())
        sys.exit(0)
    signal.signal(signal.SIGTERM, _end)
    try:
        sys.exit(run_cli("lfa", build(sys.argv[1:2])))
    except KeyboardInterrupt:
        sys.exit(130)
    except ModuleNotFoundError as error:
        extra = EXTRAS.get((error.name or "").partition(".")[0])
        if extra is None:
            raise
        sys.exit(_say("lfa", f"{sys.argv[1]} needs {error.name}: install with: pip install 'lfa[{extra}]'"))


def _end(*_: object) -> None:
    """SIGTERM ends a command as Ctrl-C does: what it has started is ended, what it has laid out is removed."""
    sys.exit(128 + signal.SIGTERM)


def overview() -> str:
    """What `lfa --help` prints."""
    rows = (f"  {entry.name:<12}{entry.help}" for entry in COMMANDS)
    return "\n".join(["Usage: lfa COMMAND [ARGUMENTS]...", "", _ABOUT, "", *rows, "", _MORE])


def build(called: Sequence[str]) -> typer.Typer:
    """All commands; only those that are `called` are imported, the others are known by name and help."""
    import typer

    app = typer.Typer(name="lfa", help=_ABOUT, no_args_is_help=True, **_PLAIN)
    for entry in COMMANDS:
        function = import_module(entry.module).command if entry.name in called else _absent
        app.command(entry.name, help=entry.help, epilog=f"Example: {entry.example}", no_args_is_help=False)(function)
    return app


def run_cli(name: str, app: typer.Typer) -> int:
    """Run `app` on the command line; the exit code. Used by all scripts of `deploy`."""
    import typer

    from protocol.mission import Refused

    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # a terminal that knows no degree sign is no reason to stop
    try:
        code = app(standalone_mode=False, prog_name=name)
    except Refused as refused:
        return _say(name, *getattr(refused, "lines", (str(refused),)))
    except typer.TyperException as error:  # what the parser refuses: an unknown option, a word for a number
        return _say(name, error.format_message())
    except typer.Abort:
        return 130
    except BrokenPipeError:  # the reader of a pipe has gone: nobody is left to tell
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except OSError as error:
        if error.errno in NAMES:
            return _say(name, f"{error.filename}: {error.strerror}: must be the path of a file or a folder")
        if error.errno not in DISK:
            raise
        where = f"{error.filename}: " if error.filename else ""
        _say(name, f"{where}{error.strerror}: must be a place that has room, and that this user may use")
        return 1
    return code if isinstance(code, int) else 0


def command_app(function: Callable[..., Any], help_text: str, example: str) -> typer.Typer:
    """A script of one command."""
    import typer

    app = typer.Typer(**_PLAIN)
    app.command(help=help_text, epilog=f"Example: {example}")(function)
    return app


def _say(name: str, *texts: str) -> int:
    for text in texts:
        print(f"{name}: {' '.join(text.split())}", file=sys.stderr)
    return 2


def _absent() -> None:
    """Stands for a command that was not called."""


_PLAIN: dict[str, Any] = {
    "add_completion": False,
    "context_settings": {"help_option_names": ["-h", "--help"]},
    "rich_markup_mode": None,
    "pretty_exceptions_enable": False,
}
_ABOUT = "A chain of robots, each its own process, that survives the loss of its leader."
_MORE = """\
Each has --help with an example: lfa run --help. For a first look: lfa run paper_path1 --fault 'kill leader at 20 s'"""
