"""Every key of a TOML text has the line at which it stands, however the text is written."""

from __future__ import annotations

import os
import tomllib
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfa.protocol.config_file.mistake import RefusedFile
from lfa.protocol.config_file.toml_file import read_toml
from lfa.protocol.config_file.toml_lines import lines_of, member
from lfa.world.description.load import SCENARIOS

#    line                                                keys that first stand in it
TEXT = (
    ('title = "a # no comment" # a comment',             ["title"]),
    ("when = 2026-01-01 10:00:00",                       ["when"]),
    ("note = '''",                                       ["note"]),
    ("[not.a.table]",                                    []),
    ("key = 1'''",                                       []),
    ("quoted.\"a.b\".c = \"\"\" \"\" \\\"\"\" \"\"\"",   ["quoted", "quoted.a.b", "quoted.a.b.c"]),
    ("[mission]",                                        ["mission"]),
    ("route = [ # of points",                            ["mission.route"]),
    ("  [0, 0],",                                        [f"mission.route[0]{part}" for part in ("", "[0]", "[1]")]),
    ('  [1, "]"], [],',                                  ["mission.route[1][1]", "mission.route[2]"]),
    ("]",                                                []),
    ("inline = { a = 1, b.c = [{ d = 2 }, { d = 3 }] }", ["mission.inline.a", "mission.inline.b.c[1].d"]),
    ("",                                                 []),
    ("[[world.things]]",                                 ["world", "world.things", "world.things[0]"]),
    ("at = 1",                                           ["world.things[0].at"]),
    ("[world.things.part]",                              ["world.things[0].part"]),
    ("deep = true",                                      ["world.things[0].part.deep"]),
    ("[[world.things]]",                                 ["world.things[1]"]),
    ("",                                                 []),
    ("at = 2",                                           ["world.things[1].at"]),
)  # fmt: skip
PLACES = [(key, n) for n, (_, keys) in enumerate(TEXT, start=1) for key in keys]


def names(value: Any, where: str = "") -> set[str]:
    """All keys and list items of a document."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return ({where} - {""}).union(*(names(item, member(where, key)) for key, item in items))


@pytest.mark.parametrize("ending", ["\n", "\r\n"])
def test_a_key_has_the_line_at_which_it_first_stands(ending: str) -> None:
    lines = lines_of(ending.join(line for line, _ in TEXT))
    assert {key: lines[key] for key, _ in PLACES} == dict(PLACES)


@pytest.mark.parametrize("path", [*sorted(SCENARIOS.glob("*.toml")), Path("deploy/fleet.example.toml")], ids=str)
def test_every_key_of_a_shipped_file_has_a_line(path: Path) -> None:
    text = path.read_text()
    assert names(tomllib.loads(text)) == lines_of(text).keys()


KEYS = st.from_regex(r"[a-z]{1,4}", fullmatch=True)
QUOTED = st.text(alphabet="ab]}#,=[{ .'", max_size=6).map(lambda text: f'"{text}"')
OTHERS = st.sampled_from(["1", "-2.5e3", "true", "inf", "1979-05-27 07:32:00", "'''a\n]'''", '"""\n="""'])


def _list(items: list[str]) -> str:
    return "[\n" + " , # ]\n".join(items) + "\n]"


def _table(items: dict[str, str]) -> str:
    return "{" + ", ".join(f"{key} = {value}" for key, value in items.items()) + "}"


VALUES = st.recursive(
    QUOTED | OTHERS,
    lambda inner: st.lists(inner, max_size=3).map(_list) | st.dictionaries(KEYS, inner, max_size=3).map(_table),
    max_leaves=8,
)


@given(st.dictionaries(KEYS, VALUES, min_size=1, max_size=4))
def test_any_text_has_a_line_for_each_of_its_keys(values: dict[str, str]) -> None:
    text = "".join(f"{key} = {value}\n" for key, value in values.items())
    lines = lines_of(text)
    assert names(tomllib.loads(text)) == lines.keys()
    assert all(text.splitlines()[lines[key] - 1].startswith(f"{key} = ") for key in values)


@pytest.mark.parametrize("text", ["", "\n \n", "# a comment", None])
def test_a_file_without_a_key_is_one_mistake(text: str | None, tmp_path: Path) -> None:
    """None: a named pipe that nobody writes to."""
    path = tmp_path / "scenario.toml"
    os.mkfifo(path) if text is None else path.write_text(text)
    with pytest.raises(RefusedFile) as refused:
        read_toml(path, "a scenario file")
    assert refused.value.lines == (f"{path}: holds no key: must be a scenario file in TOML",)
