"""The garbage collector while a team is simulated."""

from __future__ import annotations

import gc
from contextlib import suppress
from pathlib import Path

from lfa.deploy.run.simulate import run
from lfa.protocol.node import Envelope, Received
from lfa.protocol.topics import key
from lfa.world.collection import SELDOM, seldom_collected
from lfa.world.description.load import load


class Watch:
    """Node that notes the collector's thresholds at each of its ticks, ten a second."""

    name, incarnation, finished, refusal = "watch", 1, False, None
    interests = frozenset({key("sim", "watch", "ask")})

    def __init__(self) -> None:
        self.seen: list[tuple[int, int, int]] = []

    def next_deadline(self) -> float:
        return 0.1 * len(self.seen)

    def tick(self, now: float) -> list[Envelope]:
        self.seen.append(gc.get_threshold())
        return []

    def receive(self, received: Received) -> list[Envelope]:
        return []


def test_a_run_that_is_simulated_has_the_collector_search_seldom(tmp_path: Path) -> None:
    watch = Watch()
    run(load("straight", ["time_limit_s=1.0", "world.lidar.beams=0"]), 1, tmp_path / "run", drivers=[watch])
    assert len(watch.seen) > 4
    assert set(watch.seen) == {SELDOM}


def test_the_collector_is_as_before_when_a_run_has_ended_by_an_error() -> None:
    before = gc.get_threshold()
    with suppress(KeyboardInterrupt), seldom_collected():
        raise KeyboardInterrupt
    assert gc.get_threshold() == before
