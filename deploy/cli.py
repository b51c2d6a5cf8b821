"""`lfa`: a table of commands. The module of a command is imported when it is called, so `lfa --help` stays quick.

Every command module has a function `command`. Bad input, ours or the parser's, is one line on stderr and exit code 2.
"""

from __future__ import annotations

import signal
import sys
from collections.abc import Sequence
from importlib import import_module
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    import typer
from lfa.deploy.command_line import PLAIN, print_errors, run_cli


class Command(NamedTuple):
    name: str
    module: str
    help: str
    example: str


COMMANDS = (
    Command("run", "lfa.deploy.run.launch", "Start router, world and agents as processes here; write a run folder.",
          "lfa run paper_path1 --robots 4 --fault 'kill leader at 20 s'"),
    Command("sim", "lfa.deploy.run.simulate", "The same in one process, in virtual time; the same run folder.",
          "lfa sim paper_path1 --seed 7 --set world.lidar.beams=90"),
    Command("fuzz", "lfa.deploy.fuzz.command", "Hunt for schedules of faults that break the lease protocol.",
          "lfa fuzz --seeds 1000 --jobs 2; lfa fuzz --seed 147 -v; lfa fuzz --whole"),
    Command("up", "lfa.deploy.fleet.up", "Bring a fleet up on its machines, over ssh, and wait until all of it drives.",
          "lfa up deploy/fleet.example.toml"),
    Command("ps", "lfa.deploy.fleet.ps", "What runs on which machine of a fleet.",
          "lfa ps --json"),
    Command("top", "lfa.deploy.fleet.top", "A fleet's machines and robots on one screen, live.",
          "lfa top"),
    Command("logs", "lfa.deploy.fleet.logs", "The log of one process of a fleet, or of all, wherever it runs.",
          "lfa logs -f robot3"),
    Command("restart", "lfa.deploy.fleet.restart", "End one process of a fleet and start it again, wherever it runs.",
          "lfa restart robot3"),
    Command("doctor", "lfa.deploy.fleet.doctor", "What keeps a fleet's machines, or this one, from running.",
          "lfa doctor deploy/fleet.example.toml"),
    Command("down", "lfa.deploy.fleet.down", "End a fleet on all its machines.",
          "lfa down"),
    Command("fault", "lfa.deploy.operate.fault", "Do something to a robot of a running fleet.",
          "lfa fault kill leader; lfa fault stop world; lfa fault restart 3; lfa fault cut 1>2"),
    Command("forget", "lfa.deploy.operate.forget", "Robots lost for good: a fleet without memory waits for them no more.",
          "lfa forget 3"),
    Command("formation", "lfa.deploy.operate.formation", "Ask the leader of a running fleet for another formation.",
          "lfa formation column"),
    Command("watch", "lfa.deploy.view.terminal.watch", "How a running fleet stands, live on the terminal; keys do things to it.",
          "lfa watch --once"),
    Command("view", "lfa.deploy.view.rerun.command", "A recording or a running fleet in the rerun viewer, a browser, or a picture.",
          "lfa view runs/paper_path1-20260101-120000 --screenshot run.png"),
    Command("record", "lfa.deploy.fleet.record", "Record a fleet that runs already.",
          "lfa record --seconds 60"),
    Command("topic", "lfa.deploy.view.terminal.topic", "What travels in a running fleet: list, echo, hz.",
          "lfa topic echo robot2/pose --count 1"),
    Command("list", "lfa.deploy.config.scenarios", "The shipped scenarios.",
          "lfa list --json"),
    Command("validate", "lfa.deploy.config.validate", "Check a scenario file, and say what a seed makes of it.",
          "lfa validate my_course.toml --set mission.leading.cruise_mps=0.3"),
    Command("schema", "lfa.deploy.config.schema", "Every key of a scenario: JSON schema for editors, or a table.",
          "lfa schema --markdown"),
    Command("plot", "lfa.deploy.view.figures.command", "Draw the figures of a run folder.",
          "lfa plot runs/paper_path1-20260101-120000"),
    Command("report", "lfa.deploy.view.report.command", "One HTML page about a run, or about two side by side.",
          "lfa report runs/paper_path1-20260101-120000"),
    Command("replay", "lfa.deploy.analysis.verification.replay", "Run cores again on their journals and compare; or play a recording back.",
          "lfa replay runs/paper_path1-20260101-120000 --robot 2"),
    Command("verify", "lfa.deploy.analysis.verification.command", "Check runs: the lease's invariants, the shapes of the paper's figures.",
          "lfa verify runs/paper_path1-20260101-120000 runs/paper_path2-20260101-120100"),
    Command("map", "lfa.deploy.analysis.verification.explored_map", "What an explorer came to know, as a ROS map.yaml and pgm.",
          "lfa map runs/explore-20260101-120000 --out maps"),
    Command("keys", "lfa.deploy.fleet.keys_command", "A fleet's certificates, and who may say what: init, rotate, revoke, show.",
          "lfa keys init keys --robots 12 --hosts a=10.0.0.1,b=10.0.0.2; lfa keys revoke keys robot3"),
    Command("bench", "lfa.deploy.bench.command", "Measure, beside the bar to be reached.",
          "lfa bench lidar --json"),
    Command("completion", "lfa.deploy.completion", "Print a script that completes commands and options in your shell.",
          "lfa completion bash > ~/.local/share/bash-completion/completions/lfa"),
)  # fmt: skip


EXTRAS = {
    "numpy": "world", "PIL": "world", "pymunk": "world", "matplotlib": "view", "mcap": "view", "rerun": "view",
    "zstandard": "view", "rich": "deploy", "asyncssh": "deploy", "cryptography": "deploy",
}  # fmt: skip
"""What is not in the base install, by the extra that brings it."""


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
        sys.exit(print_errors("lfa", f"{sys.argv[1]} needs {error.name}: install with: pip install 'lfa[{extra}]'"))


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

    app = typer.Typer(name="lfa", help=_ABOUT, no_args_is_help=True, **PLAIN)
    for entry in COMMANDS:
        function = import_module(entry.module).command if entry.name in called else _absent
        app.command(entry.name, help=entry.help, epilog=f"Example: {entry.example}", no_args_is_help=False)(function)
    return app


def _absent() -> None:
    """Stands for a command that was not called."""


_ABOUT = "A chain of robots, each its own process, that survives the loss of its leader."
_MORE = """\
Each has --help with an example: lfa run --help. For a first look: lfa run paper_path1 --fault 'kill leader at 20 s'"""
