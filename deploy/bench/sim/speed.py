"""Speed of simulated teams on one core: agents, world, codec, journals and recording, in processor time.

Beside each in the same run: the bare cost of its messages, each encoded, decoded and recorded once more, while nobody
sends or hears them. The summary that `lfa sim` computes at the end is no part of it. A team below its bar is simulated
a little longer under a profiler, which names the next bottleneck: the folders of the code that take most of the time.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from fnmatch import fnmatchcase
from functools import partial
from itertools import islice
from math import log
from pathlib import Path
from statistics import mean
from time import process_time

from msgspec import Struct

from lfa.deploy.bench.harness.rows import BenchRow, Quantity, row, show
from lfa.deploy.bench.sim.time_shares import profiled
from lfa.deploy.recording.recorder import Recorder
from lfa.deploy.run.simulate import SimulatedRun
from lfa.protocol.errors import Refused
from lfa.protocol.messages.codec import Message, decode, encode
from lfa.world.collection import seldom_collected
from lfa.world.description.load import draw, load

SCENARIO, SEED, BEAMS = "straight", 1, 180
"""A column of robots on a straight way: its density is the same for any number of robots."""
FROM_S = 1.0
"""Time [s] of a run from which it is measured: the leader leads, and the chain is closed."""
EXPONENT_MAX = 1.1
FOLDERS_SHOWN = 5
"""Number of folders that the profile of a team below its bar names."""


class SpeedCase(Struct, frozen=True):
    """Team to simulate until `until_s` [s]; `times_min`: least factor over real time, None without a bar."""

    robots: int
    control_hz: float
    until_s: float
    times_min: float | None = None
    profiled_s: float = 0.5
    """Time [s] that is simulated under the profiler where the team is below its bar."""
    beams: int = BEAMS
    """Number of beams of each robot's scanner; 0 without one."""

    @property
    def name(self) -> str:
        return f"{self.robots} robots{'' if self.beams else ' without lidar'} at {self.control_hz:g} Hz"


CASES = (
    SpeedCase(4, 50.0, 21.0, 30.0),
    SpeedCase(20, 50.0, 7.0, 5.0),
    SpeedCase(50, 50.0, 3.0),
    SpeedCase(20, 20.0, 7.0),
    SpeedCase(50, 20.0, 4.0),
    SpeedCase(100, 20.0, 3.0, 2.0),
    SpeedCase(200, 10.0, 2.0, beams=0),
)
CASES_FULL = (*CASES, SpeedCase(1000, 10.0, 2.0, 0.5, profiled_s=0.1, beams=0))
"""All cases: the first election of a thousand robots alone is some ten minutes, and several GiB, of messages."""
GROWTH, GROWTH_HZ = "growth", 20.0
"""Name of the exponent's row, and control rate [Hz] of the cases that it is fitted to."""


class Cost(Struct, frozen=True):
    """Processor time [s] of one simulated second: of the whole run, and of its messages alone."""

    run_s: float
    messages_s: float
    shares: dict[str, float] = {}
    """Share of the time [%] of each folder of the code, the largest first; empty where the bar is met."""


def run(as_json: bool, rows: str = "*", full: bool = False) -> int:
    """Print the matching rows; return 0 if all hold, else 1. `full`: a thousand robots, too.

    Raises Refused if no row can match.
    """
    growth, chosen = chosen_by(rows, CASES_FULL if full else CASES)
    return show(([one for one in some if fnmatchcase(one.name, rows)] for some in _rows(growth, chosen)), as_json)


def chosen_by(rows: str, cases: Sequence[SpeedCase] = CASES) -> tuple[bool, list[SpeedCase]]:
    """Return whether the glob `rows` asks for the exponent, and the cases to measure for it: a team takes its time.

    Raises Refused if no row can match.
    """
    team = rows.partition("/")[0]
    growth = fnmatchcase(GROWTH, team)
    chosen = [case for case in cases if fnmatchcase(case.name, team) or (growth and case.control_hz == GROWTH_HZ)]
    if not chosen:
        names = ", ".join((*(case.name for case in cases), GROWTH))
        raise Refused(f"--rows {rows!r}: no row has such a name; they begin with {names}")
    return growth, chosen


def _rows(growth: bool, chosen: Sequence[SpeedCase]) -> Iterator[list[BenchRow]]:
    costs: dict[int, float] = {}
    for case in chosen:
        cost = cost_of(case)
        if case.control_hz == GROWTH_HZ:
            costs[case.robots] = cost.run_s
        yield [
            row(case.name, Quantity("times real time", "1", case.times_min, "at least"), 1.0 / cost.run_s),
            row(case.name, Quantity("times the bare cost of its messages", "1"), cost.run_s / cost.messages_s),
            *(
                row(case.name, Quantity(f"share of {folder}", "%"), share)
                for folder, share in islice(cost.shares.items(), FOLDERS_SHOWN)
            ),
        ]
    if growth:
        yield [row(GROWTH, Quantity("exponent of cost over robots", "1", EXPONENT_MAX), exponent(costs))]


def cost_of(case: SpeedCase) -> Cost:
    """Simulate and return the cost of one simulated second after `FROM_S`."""
    settings = [f"mission.control_hz={case.control_hz}", f"world.lidar.beams={case.beams}"]
    drawn = draw(load(SCENARIO, settings, case.robots), SEED)
    simulated_s = case.until_s - FROM_S
    said: list[tuple[float, str, Message]] = []
    with tempfile.TemporaryDirectory(prefix="lfa-") as place, seldom_collected():  # as `lfa sim`
        recorder = Recorder(_folder(place, "run"), {})

        def record(t: float, key: str, message: Message) -> None:
            if t >= FROM_S:  # the first election of a thousand robots is millions of messages
                said.append((t, key, message))
                recorder.record(t, key, message)

        team = SimulatedRun(drawn, SEED, (), record, Path(place) / "journal")
        team.advance(FROM_S)
        began = process_time()
        team.advance(case.until_s)
        run_s = process_time() - began
        messages_s = _bare_s(said, _folder(place, "bare"))
        falls_short = case.times_min is not None and simulated_s / run_s < case.times_min
        shares = profiled(partial(team.advance, case.until_s + case.profiled_s)) if falls_short else {}
        team.close()
        recorder.close()
    return Cost(run_s / simulated_s, messages_s / simulated_s, shares)


def exponent(costs: dict[int, float]) -> float:
    """Return the exponent of cost over robots: the slope of the line of least squares through their logarithms."""
    x, y = [log(robots) for robots in costs], [log(cost) for cost in costs.values()]
    x_mean, y_mean = mean(x), mean(y)
    together = sum((a - x_mean) * (b - y_mean) for a, b in zip(x, y, strict=True))
    return together / sum((a - x_mean) * (a - x_mean) for a in x)


def _bare_s(said: Sequence[tuple[float, str, Message]], folder: Path) -> float:
    """Return the processor time [s] to encode, decode and record the messages once more."""
    recorder = Recorder(folder, {})
    began = process_time()
    for t, key, message in said:
        recorder.record(t, key, decode(encode(message), type(message)))
    spent_s = process_time() - began
    recorder.close()
    return spent_s


def _folder(place: str, name: str) -> Path:
    folder = Path(place) / name
    folder.mkdir()
    return folder
