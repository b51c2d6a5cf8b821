"""The `lfa` script: a table of commands. A command's module is imported when it is called, to keep `lfa --help` fast.

Every command module has a function `command`. Bad input, refused by the command or by the parser, is one line on
stderr and exit code 2.
"""

from __future__ import annotations

import lfa.protocol.program_start.installed_first  # noqa: F401 (before any other module)

# isort: split
import signal
import sys
from collections.abc import Sequence
from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    import typer
from lfa.deploy.command_line import PLAIN, print_refusal, print_text, run_cli
from lfa.protocol.errors import Refused


class Command(NamedTuple):
    name: str
    module: str
    help: str
    example: str


COMMANDS = (
    Command("run", "lfa.deploy.lockstep.command", "Run a scenario as processes on this machine; write a run folder.",
          "lfa run paper_path1 --robots 4 --fault 'kill leader at 20 s'"),
    Command("sim", "lfa.deploy.campaign.commands.sim",
          "Run a scenario in one process, in virtual time, once or many times; write a run folder.",
          "lfa sim paper_path1 --set world.lidar.beams=90; lfa sim circle --seeds 1..9 --set radio.loss=0.1,0.2"),
    Command("campaign", "lfa.deploy.campaign.commands.campaign",
          "Run a plan of simulations, whole or in shares; merge results into tables and a page.",
          "lfa campaign plan.toml --jobs 2; lfa campaign plan.toml --shard 3/16; lfa campaign merge runs/plan"),
    Command("fuzz", "lfa.deploy.fuzz.search.command",
          "Search for fault schedules that violate invariants of the lease.",
          "lfa fuzz --seeds 1000 --jobs 2; lfa fuzz --seed 147 -v; lfa fuzz --whole; lfa fuzz --systematic"),
    Command("step", "lfa.deploy.lockstep.step_command",
          "Let a lockstep run that stands go on, by some ticks or without an end.",
          "lfa run straight --lockstep --pause; lfa step 50; lfa step"),
    Command("up", "lfa.deploy.fleet.up", "Start a fleet on its machines, over ssh; wait until all are in the chain.",
          "lfa up deploy/fleet.example.toml"),
    Command("export", "lfa.deploy.fleet.export.command",
          "Write a fleet for systemd, Quadlet, Compose, Kubernetes or Nomad, or a scenario's world as SDF or ROS map.",
          "lfa export compose deploy/fleet.example.toml --out convoy; lfa export sdf straight"),
    Command("import", "lfa.deploy.worlds.import_command",
          "Make a scenario of a world: IR-SIM YAML, MovingAI .map, SDF, an SVG drawing, a ROS map.",
          "lfa import arena.map; lfa import hall.sdf --robots 3 --goal 12,-3; lfa import plan.svg --unit-m 0.01"),
    Command("ps", "lfa.deploy.fleet.ps", "List the processes of a fleet by machine.",
          "lfa ps --json"),
    Command("top", "lfa.deploy.fleet.top", "Show the machines and robots of a fleet on one screen, live.",
          "lfa top"),
    Command("logs", "lfa.deploy.fleet.logs", "Print the log of one process of a fleet, or of all, on any machine.",
          "lfa logs -f robot3"),
    Command("restart", "lfa.deploy.fleet.restart", "Restart one process of a fleet, on any machine.",
          "lfa restart robot3"),
    Command("upgrade", "lfa.deploy.fleet.upgrade",
          "Bring the machines of a running fleet to the lfa installed here, one by one, the leader's last.",
          "lfa upgrade deploy/fleet.example.toml"),
    Command("doctor", "lfa.deploy.fleet.doctor", "Check the machines of a fleet, or this one, for faults.",
          "lfa doctor deploy/fleet.example.toml"),
    Command("down", "lfa.deploy.fleet.down", "Stop a fleet on all its machines.",
          "lfa down"),
    Command("fault", "lfa.deploy.operate.fault", "Inject a fault into a running fleet: robots, world, router or links.",
          "lfa fault kill leader; lfa fault stop world; lfa fault restart 3; lfa fault cut 1>2"),
    Command("forget", "lfa.deploy.operate.forget",
          "Declare robots permanently lost, so that a fleet without a config can start.",
          "lfa forget 3"),
    Command("stop", "lfa.deploy.operate.stop", "Stop every robot of a running fleet, and say who has not stopped.",
          "lfa stop; lfa stop --json"),
    Command("resume", "lfa.deploy.operate.resume", "Lift a stop: the fleet goes on with what it was doing.",
          "lfa resume"),
    Command("pause", "lfa.deploy.operate.pause", "Let the leader of a running fleet stand, and its team with it.",
          "lfa pause; lfa go"),
    Command("go", "lfa.deploy.operate.go", "Send a running fleet to another goal or along a route, or end a pause.",
          "lfa go 3 -1.5 90; lfa go --route route.txt; lfa go"),
    Command("home", "lfa.deploy.operate.home", "Send a running fleet back to its mission's first way-point.",
          "lfa home"),
    Command("set", "lfa.deploy.operate.set", "Change speed, motion or formation of a running fleet.",
          "lfa set cruise_mps=0.3 separation_m=1.5"),
    Command("teleop", "lfa.deploy.operate.teleop", "Drive the leader of a running fleet by keyboard; the team follows.",
          "lfa pause; lfa teleop"),
    Command("join", "lfa.deploy.operate.join", "Take a spare robot into a running team, or one that has retired.",
          "lfa join 7; lfa join 7 --for 3"),
    Command("retire", "lfa.deploy.operate.retire", "Take a robot out of a running team: the rest close up.",
          "lfa retire 3"),
    Command("formation", "lfa.deploy.operate.formation", "Ask the leader of a running fleet for another formation.",
          "lfa formation column"),
    Command("watch", "lfa.deploy.view.terminal.watch",
          "Show the state of a running fleet live; keys inject faults and commands.",
          "lfa watch --once"),
    Command("view", "lfa.deploy.view.rerun.command",
          "Show a recording or a running fleet in rerun, in a browser, or as a picture.",
          "lfa view runs/paper_path1-20260101-120000 --screenshot run.png"),
    Command("web", "lfa.deploy.web.command", "Open a page on a team: click a robot dead, watch the next one lead.",
          "lfa web leader_killed --seed 7"),
    Command("record", "lfa.deploy.fleet.record", "Record a running fleet.",
          "lfa record --seconds 60"),
    Command("topic", "lfa.deploy.view.terminal.topic", "Inspect the topics of a running fleet: list, echo, hz.",
          "lfa topic echo robot2/pose --count 1"),
    Command("metrics", "lfa.deploy.metrics.command",
          "Serve the state of a running fleet as OpenMetrics text, for Prometheus and Grafana.",
          "lfa metrics --listen 127.0.0.1:9464"),
    Command("list", "lfa.deploy.config.scenarios", "List the shipped scenarios.",
          "lfa list --json"),
    Command("validate", "lfa.deploy.config.validate",
          "Check a scenario or fleet file: `ok`, or every mistake with its line.",
          "lfa validate my_course.toml --set mission.leading.cruise_mps=0.3"),
    Command("schema", "lfa.deploy.config.schema",
          "Print all keys of a scenario or fleet file, as JSON schema or as a table.",
          "lfa schema --markdown"),
    Command("plot", "lfa.deploy.view.figures.command", "Draw the figures of a run folder.",
          "lfa plot runs/paper_path1-20260101-120000"),
    Command("report", "lfa.deploy.view.report.command", "Write one HTML page about a run, or about two side by side.",
          "lfa report runs/paper_path1-20260101-120000"),
    Command("replay", "lfa.deploy.analysis.verification.replay",
          "Re-execute cores on their journals and compare, or play a recording back.",
          "lfa replay runs/paper_path1-20260101-120000 --robot 2"),
    Command("diff", "lfa.deploy.lockstep.diff_command",
          "Compare two runs in virtual time by their state hashes: the first tick and process that differ.",
          "lfa diff runs/straight-20260101-120000 runs/straight-20260101-120100"),
    Command("verify", "lfa.deploy.analysis.verification.command",
          "Check runs: the invariants of the lease, and the paper's figures.",
          "lfa verify runs/paper_path1-20260101-120000 runs/paper_path2-20260101-120100"),
    Command("why", "lfa.deploy.analysis.causes.command",
          "Explain each leader change, stop, contact and wait of a run by its chain of causes.",
          "lfa why runs/paper_path1-20260101-120000 --of leader-change"),
    Command("map", "lfa.deploy.analysis.verification.explored_map",
          "Export the map of an exploration run as a ROS map.yaml and pgm.",
          "lfa map runs/explore-20260101-120000 --out maps"),
    Command("ros", "lfa.deploy.ros.bridge.command", "Show a running fleet as ROS 2 topics; take orders of ROS users.",
          "lfa ros --serve"),
    Command("foxglove", "lfa.deploy.ros.bridge.foxglove_command",
          "Show a running fleet live in Foxglove or Lichtblick.",
          "lfa foxglove"),
    Command("bag", "lfa.deploy.ros.bag", "Write a run as a rosbag2 folder, for ros2 bag play, Foxglove, PlotJuggler.",
          "lfa bag runs/paper_path1-20260101-120000"),
    Command("keys", "lfa.deploy.fleet.keys_command",
          "Manage certificates and publish rights: init, csr, rotate, revoke, show.",
          "lfa keys init keys --robots 12 --hosts a=10.0.0.1,b=10.0.0.2; lfa keys revoke keys robot3"),
    Command("bench", "lfa.deploy.bench.harness.command",
          "Run a benchmark; each figure is printed beside its required value.",
          "lfa bench lidar --json"),
    Command("completion", "lfa.deploy.completion", "Print a script that completes commands and options in your shell.",
          "lfa completion bash > ~/.local/share/bash-completion/completions/lfa"),
)  # fmt: skip
RUNS, RECORDINGS, ROS = ("numpy", "pymunk", "PIL", "mcap"), ("numpy", "mcap"), ("numpy", "rosbags", "xxhash")
NEEDS: dict[str, tuple[str, ...]] = {
    "run": RUNS, "sim": RUNS, "verify": RUNS, "map": RUNS, "record": RECORDINGS, "plot": (*RECORDINGS, "matplotlib"),
    "report": (*RECORDINGS, "matplotlib"), "view": (*RECORDINGS, "rerun"), "bag": (*ROS, "mcap"), "ros": ROS,
    "foxglove": (*ROS, "foxglove"), "up": ("cryptography",), "keys": ("cryptography",), "top": ("rich",),
    "web": (*RUNS, "websockets"), "import": (*RUNS, "yaml"), "why": RECORDINGS, "replay": RUNS, "campaign": RUNS,
    "bench": RUNS,
}  # fmt: skip
"""Modules outside the base install without which a command can do nothing."""
TAKES_NUMBERS = frozenset({"go", "join", "retire", "forget"})
"""Commands whose arguments are numbers, which may begin with a minus sign, as in `lfa go 3 -1.5`."""
EXTRAS = {
    "numpy": "world", "PIL": "world", "pymunk": "world", "yaml": "world", "matplotlib": "view", "mcap": "view",
    "rerun": "view", "zstandard": "view", "rich": "deploy", "asyncssh": "deploy", "cryptography": "deploy",
    "pyarrow": "campaign", "submitit": "slurm", "distributed": "dask",
    "rosbags": "ros", "xxhash": "ros", "foxglove": "foxglove", "websockets": "web",
    "gymnasium": "learn", "pettingzoo": "learn", "onnxruntime": "onnx",
}  # fmt: skip
"""Modules outside the base install, each with the extra that installs it."""


def main() -> None:
    """Run the `lfa` script. Exit codes: 0 ok, 1 a run or an assertion failed, 2 bad input, 130 and 143 on signals."""
    if sys.argv[1:] == ["--version"]:
        from lfa.deploy.version import version_line

        sys.exit(print_text("lfa", version_line()))
    if sys.argv[1:] in ([], ["-h"], ["--help"]):  # before the parser is imported: that import dominates
        sys.exit(print_text("lfa", overview()))
    signal.signal(signal.SIGTERM, _end)
    absent = _absent_modules(sys.argv[1])
    if absent and not {"-h", "--help"} & set(sys.argv[2:]):
        sys.exit(print_refusal("lfa", Refused(_install(sys.argv[1], absent))))
    try:
        sys.exit(run_cli("lfa", build(sys.argv[1:2])))
    except KeyboardInterrupt:
        sys.exit(130)
    except ModuleNotFoundError as error:
        module = (error.name or "").partition(".")[0]
        if module not in EXTRAS:
            raise
        sys.exit(print_refusal("lfa", Refused(_install(sys.argv[1], [module]))))


def _absent_modules(name: str) -> list[str]:
    """Return the modules that a command needs and that are not installed: known before it does anything."""
    return [module for module in NEEDS.get(name, ()) if find_spec(module) is None]


def _install(name: str, absent: Sequence[str]) -> str:
    extras = [EXTRAS[module] for module in absent if module != "numpy"] or [EXTRAS["numpy"]]  # the others bring numpy
    return f"{name} needs {', '.join(absent)}: install with: pip install 'lfa[{','.join(dict.fromkeys(extras))}]'"


def _end(*_: object) -> None:
    """Exit on SIGTERM as on Ctrl-C, so that a command terminates its processes and removes its temporary files."""
    sys.exit(128 + signal.SIGTERM)


def overview() -> str:
    """Return the text of `lfa --help`."""
    rows = (f"  {entry.name:<12}{entry.help}" for entry in COMMANDS)
    return "\n".join(["Usage: lfa COMMAND [ARGUMENTS]...", "", _ABOUT, "", *rows, "", _MORE])


def build(called: Sequence[str]) -> typer.Typer:
    """Return the parser with all commands. Only the `called` ones are imported; the others have name and help only."""
    import typer

    app = typer.Typer(name="lfa", help=_ABOUT, no_args_is_help=True, **PLAIN)
    for entry in COMMANDS:
        function = import_module(entry.module).command if entry.name in called else _absent
        app.command(
            entry.name,
            help=entry.help,
            epilog=f"Example: {entry.example}",
            no_args_is_help=False,
            context_settings={"ignore_unknown_options": entry.name in TAKES_NUMBERS},
        )(function)
    return app


def _absent() -> None:
    """Stand in for a command that was not called."""


_ABOUT = "A chain of robots, each its own process, that survives the loss of its leader."
_MORE = """\
Each command has --help with an example: lfa run --help. First run: lfa run paper_path1 --fault 'kill leader at 20 s'"""
