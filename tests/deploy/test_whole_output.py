"""What a command writes is there whole, or not at all: on a full disk, after an error, over what was there before."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest

from lfa.deploy.fleet.export import command as export
from lfa.deploy.fleet.security import keys
from lfa.deploy.whole_output import whole_file, whole_folder
from lfa.deploy.worlds.world_export import export_world
from lfa.protocol.errors import Refused
from tests.rigs.small_disk import small_disk

PLAN = keys.spread("f", {"a": ("10.0.0.1",), "b": ("10.0.0.2",)}, (1, 2, 3))
FLEET = 'fleet = "f"\nkeys = "keys"\nscenario = "straight"\nteam = 2\nhosts.a.address = "localhost"\n'


def _export(engine: str) -> Callable[[Path], object]:
    return lambda place: export.command(engine, Path("fleet.toml"), place)  # type: ignore[arg-type]


WRITTEN: dict[str, Callable[[Path], object]] = {
    "lfa keys init": lambda place: keys.make(place, PLAN),
    "lfa export compose": _export("compose"),
    "lfa export systemd": _export("systemd"),
    "lfa export nomad": _export("nomad"),
    "lfa export sdf": lambda place: export_world("sdf", "explore", place),
    "lfa export map": lambda place: export_world("map", "explore", place),
}


def _said(write: Callable[[], object]) -> str:
    try:
        write()
    except Refused as refused:
        return str(refused)
    return ""


@pytest.mark.parametrize("there", [False, True])
@pytest.mark.parametrize("name", WRITTEN)
def test_a_full_disk_leaves_no_part_of_a_folder(
    name: str, there: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At whatever file the disk is full: with more pages at each attempt, until there is room for all."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "fleet.toml").write_text(FLEET)
    for pages in (1, 2, 3, 5, 12, 25, 40, 60, 4000):
        with small_disk(tmp_path / "disk", 4 * pages) as disk:
            place = disk / "in" / "place"
            if there:
                place.mkdir(parents=True)
            before = sorted(disk.rglob("*"))
            said = _said(lambda place=place: WRITTEN[name](place))
            if not said:
                assert not [path for path in disk.rglob("*") if path.name.startswith(".")]
                break
            assert "No space left" in said
            assert str(place) in said
            assert sorted(disk.rglob("*")) == before
    else:
        pytest.fail("there never was room")
    assert pages > 1


def test_keys_that_wait_for_an_outside_authority_stay(tmp_path: Path) -> None:
    keys.make(tmp_path / "ours", PLAN)
    with pytest.raises(Refused, match="not signed yet") as refused:
        keys.make(tmp_path / "keys", PLAN, ca_cert=tmp_path / "ours/ca.pem")
    assert str(tmp_path / "keys" / "requests") in str(refused.value)
    assert len(list((tmp_path / "keys/requests").iterdir())) == len(PLAN.places)
    assert (tmp_path / "keys").stat().st_mode & 0o777 == 0o700


def test_what_was_there_is_replaced_when_all_is_written_and_not_before(tmp_path: Path) -> None:
    (tmp_path / "map.pgm").write_text("old")
    with suppress(KeyboardInterrupt), whole_folder(tmp_path) as fresh:
        (fresh / "map.pgm").write_text("half")
        raise KeyboardInterrupt
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [("map.pgm", "old")]
    with whole_folder(tmp_path) as fresh:
        (fresh / "map.pgm").write_text("new")
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [("map.pgm", "new")]


def test_a_file_is_replaced_when_it_is_whole(tmp_path: Path) -> None:
    path = tmp_path / "clip.html"
    path.write_text("old")
    with suppress(KeyboardInterrupt), whole_file(path) as fresh:
        fresh.write_text("half")
        raise KeyboardInterrupt
    assert [(entry.name, entry.read_text()) for entry in tmp_path.iterdir()] == [("clip.html", "old")]
    with whole_file(path) as fresh:
        fresh.write_text("new")
    assert [(entry.name, entry.read_text()) for entry in tmp_path.iterdir()] == [("clip.html", "new")]


def test_a_device_is_written_as_such() -> None:
    with whole_file(Path("/dev/null")) as fresh:
        fresh.write_text("text")
    assert Path("/dev/null").is_char_device()
