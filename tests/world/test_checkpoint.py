"""A world that starts again goes on from where the one before it stood."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest

from lfa.protocol.errors import Refused
from lfa.protocol.messages.simulation import Truth
from lfa.world import checkpoint
from lfa.world.description.load import draw, load
from lfa.world.description.scenario import STATE
from lfa.world.world import World
from tests.rigs.small_disk import fill, small_disk

SCENARIO = draw(load("paper_path1"), 7)


def last_truth(world: World, since: float, until: float) -> Truth:
    """The last ground truth that `world` says between these moments, ticked as it asks for it."""
    truths: list[Truth] = []
    while world.next_deadline() <= until:
        said = world.tick(max(world.next_deadline(), since))
        truths += [envelope.message for envelope in said if isinstance(envelope.message, Truth)]
    return truths[-1]


def test_time_robots_and_obstacles_go_on_from_the_state() -> None:
    first = World("f", SCENARIO, 7, 1, start_at=10.0)
    before = last_truth(first, 10.0, 12.0)
    known = msgspec.json.decode(msgspec.json.encode(first.memory()), type=checkpoint.Memory)
    second = World("f", checkpoint.resumed(SCENARIO, known), 7, 2, start_at=50.0, memory=known)
    after = last_truth(second, 50.0, 50.015)
    assert after.robots == before.robots
    assert 0.0 < after.time_s - before.time_s < 0.03
    moved_m = max(abs(a.x - b.x) + abs(a.y - b.y) for a, b in zip(after.obstacles, before.obstacles, strict=True))
    assert moved_m < 0.01, "an obstacle jumped"


def test_the_state_of_another_team_is_refused() -> None:
    known = World("f", SCENARIO, 7, 1, start_at=0.0)
    last_truth(known, 0.0, 0.1)
    other = draw(load("paper_path1", robots=2), 7)
    with pytest.raises(Refused, match="--resume"):
        checkpoint.resumed(other, known.memory())


def test_a_folder_without_a_state_is_refused_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(Refused, match="--resume"):
        checkpoint.read(tmp_path)
    (tmp_path / STATE).write_text("{")
    with pytest.raises(Refused, match="must be the state of a world"):
        checkpoint.read(tmp_path)


def test_on_a_full_disk_the_world_goes_on_and_says_so_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with small_disk(tmp_path / "disk", 64) as disk:
        path = disk / STATE
        path.write_bytes(b"as last kept")
        world = checkpoint.Remembering(World("f", SCENARIO, 7, 1, start_at=0.0), disk)
        filler = fill(disk)
        for _ in range(30):
            world.tick(world.next_deadline())
        assert capsys.readouterr().err == f"{path}: No space left on device: the state on disk gets old\n"
        assert path.read_bytes() == b"as last kept"
        filler.unlink()
        assert list(disk.iterdir()) == [path]
        while world.next_deadline() < checkpoint.AGAIN_S + 1.0:
            world.tick(world.next_deadline())
        assert checkpoint.read(disk).step > 0
