"""Small trees of XML files that anybody may have made: no entities, bounded depth and size."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Self
from xml.parsers import expat

from msgspec import Struct, field

from lfa.protocol.errors import Refused

ELEMENTS_MAX, DEPTH_MAX = 200_000, 100


class Element(Struct):
    """XML element: its name without a namespace, attributes, text, and the elements in it."""

    name: str
    attributes: dict[str, str]
    text: str = ""
    children: list[Self] = field(default_factory=list)

    def find(self, name: str) -> Element | None:
        """Return the first child of that name, or None."""
        return next((child for child in self.children if child.name == name), None)

    def all(self, name: str) -> Iterator[Element]:
        return (child for child in self.children if child.name == name)


def parsed(text: str) -> Element:
    """Return the root of an XML text. Raises Refused with one line."""
    parser = expat.ParserCreate()
    parser.buffer_text = True
    tree = _Tree()
    parser.StartElementHandler, parser.EndElementHandler, parser.CharacterDataHandler = tree.start, tree.end, tree.say
    parser.EntityDeclHandler = tree.entity
    try:
        parser.Parse(text.encode(), True)
    except expat.ExpatError as error:
        what = expat.errors.messages.get(error.code, "wrong")
        raise Refused(f"line {error.lineno}: {what}: must be well-formed XML") from None
    assert tree.root is not None
    return tree.root


class _Tree:
    """Builder of a tree from what the parser reports."""

    def __init__(self) -> None:
        self.root: Element | None = None
        self._open: list[Element] = []
        self._count = 0

    def start(self, name: str, attributes: dict[str, str]) -> None:
        self._count += 1
        if self._count > ELEMENTS_MAX or len(self._open) >= DEPTH_MAX:
            raise Refused(f"more than {ELEMENTS_MAX} elements, or {DEPTH_MAX} in one another: must be smaller")
        element = Element(name.rpartition(":")[2], attributes)
        if self._open:
            self._open[-1].children.append(element)
        else:
            self.root = element
        self._open.append(element)

    def end(self, _name: str) -> None:
        self._open.pop()

    def say(self, text: str) -> None:
        if self._open:
            self._open[-1].text += text

    def entity(self, name: str, *_: object) -> None:
        raise Refused(f"declares the entity {name[:40]!r}: must have none, they can grow without end")
