"""Line numbers of the keys of a TOML text, which `tomllib` does not tell.

The text must be valid: `tomllib` has read it before. So this scanner only finds where keys, values and tables begin; it
needs no rules of what is allowed.
"""

from __future__ import annotations

import re
import tomllib

_GAP = re.compile(r"(?:[\s,]|#[^\n]*)*")
_SPACE = re.compile(r"[ \t]*")
_KEY = re.compile(r'"(?:\\.|[^"\\])*"|\'[^\']*\'|[\w-]+')
_TEXT = re.compile(
    r'"""(?:\\.|(?!""")[^\\])*"""(?:"{0,2})|\'\'\'(?:(?!\'\'\').)*\'\'\'(?:\'{0,2})|"(?:\\.|[^"\\])*"|\'[^\']*\'',
    re.DOTALL,
)
_WORD = re.compile(r"[^\s,\]}#]+(?: \d[^\s,\]}#]*)?")
"""A number, a truth value or a date; the time after a date may stand behind a space."""


def lines_of(text: str) -> dict[str, int]:
    """Return the line, from 1, at which each key and list item first appears: `world.obstacles[2].radius_m`.

    Raises RecursionError for lists nested too deeply.
    """
    scanner = _Scanner(text)
    scanner.scan()
    return scanner.lines


def member(table: str, key: str | int) -> str:
    """Return the name of a member of a table or, by number, of a list."""
    if isinstance(key, int):
        return f"{table}[{key}]"
    return f"{table}.{key}" if table else key


class _Scanner:
    def __init__(self, text: str) -> None:
        self._text = text
        self._at = 0
        self._counted_to, self._line = 0, 1
        self._last: dict[str, int] = {}
        """Index of the last table of each list of tables."""
        self.lines: dict[str, int] = {}

    def scan(self) -> None:
        table = ""
        while self._skip(_GAP):
            if self._peek("["):
                table = self._header()
            else:
                self._pair(table)

    def _header(self) -> str:
        """Read `[a.b]` or `[[a.b]]`; return the name of the table that it opens."""
        listed = self._text.startswith("[[", self._at)
        self._at += 2 if listed else 1
        parts = self._dotted()
        self._at += 2 if listed else 1
        name = ""
        for n, part in enumerate(parts):
            name = self._mark(member(name, part))
            if listed and n == len(parts) - 1:
                self._last[name] = self._last.get(name, -1) + 1
            if name in self._last:
                name = self._mark(member(name, self._last[name]))
        return name

    def _pair(self, table: str) -> None:
        """Read `a.b = value`."""
        for part in self._dotted():
            table = self._mark(member(table, part))
        self._at += 1
        self._value(table)

    def _dotted(self) -> list[str]:
        parts = []
        while True:
            self._skip(_SPACE)
            found = _KEY.match(self._text, self._at)
            assert found is not None, "tomllib has read the text"
            self._at = found.end()
            parts.append(next(iter(tomllib.loads(f"{found[0]} = 0"))))
            self._skip(_SPACE)
            if not self._peek("."):
                return parts
            self._at += 1

    def _value(self, name: str) -> None:
        self._skip(_SPACE)
        if self._peek("["):
            self._at += 1
            count = 0
            while self._skip(_GAP) and not self._peek("]"):
                self._value(self._mark(member(name, count)))
                count += 1
            self._at += 1
        elif self._peek("{"):
            self._at += 1
            while self._skip(_GAP) and not self._peek("}"):
                self._pair(name)
            self._at += 1
        else:
            self._skip(_TEXT if self._peek('"') or self._peek("'") else _WORD)

    def _mark(self, name: str) -> str:
        self._line += self._text.count("\n", self._counted_to, self._at)
        self._counted_to = self._at
        self.lines.setdefault(name, self._line)
        return name

    def _peek(self, character: str) -> bool:
        return self._text.startswith(character, self._at)

    def _skip(self, pattern: re.Pattern[str]) -> bool:
        """Skip what `pattern` matches here; return True if text is left."""
        found = pattern.match(self._text, self._at)
        self._at = self._at if found is None else found.end()
        return self._at < len(self._text)
