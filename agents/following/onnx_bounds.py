"""Bounds of a model file (ONNX) before a runtime reads it: a few bytes of it can stand for any amount of memory.

Reads the fields of the protobuf (onnx.proto) that nest or repeat, and keeps nothing of them.
"""

from __future__ import annotations

from collections.abc import Iterator

FIELDS_MAX = 50_000
"""Maximum number of a model's fields outside its weights: the runtime makes up to a kilobyte of an empty node."""
STRUCTURE_BYTES_MAX = 1 << 20
"""Maximum length [bytes] of a model without its weights."""
DEPTH_MAX = 32
"""Maximum depth of graphs in nodes of graphs."""
MODEL, GRAPH, NODE, ATTRIBUTE, TENSOR, TRAINING = range(6)
NESTED = {
    MODEL: {7: GRAPH, 20: TRAINING},
    TRAINING: {1: GRAPH, 2: GRAPH},
    GRAPH: {1: NODE, 5: TENSOR},
    NODE: {5: ATTRIBUTE},
    ATTRIBUTE: {5: TENSOR, 6: GRAPH, 10: TENSOR, 11: GRAPH},
}
"""Fields of a message that are messages themselves, by their numbers in onnx.proto."""
REFUSED = {
    MODEL: {25: "has functions of its own, which may stand for any number of nodes (onnx.inliner takes them out)"},
    GRAPH: {15: "has sparse tensors"},
    ATTRIBUTE: {22: "has sparse tensors", 23: "has sparse tensors"},
}
"""Fields of a few bytes that stand for any amount, by their numbers in onnx.proto, and what a model with them has."""
WEIGHTS = (4, 5, 7, 9, 10, 11)
"""Fields of a tensor that hold its elements; of a kilobyte there the runtime makes at most eight."""
EXTERNAL_DATA, DATA_LOCATION, OP_TYPE = 13, 14, 4
VARINT, FIXED64, BYTES, FIXED32 = 0, 1, 2, 5
FIXED = {FIXED64: 8, FIXED32: 4}
"""Lengths [bytes] of fields of fixed length."""
BROKEN = "Failed to load model because protobuf parsing failed"


class _Unbounded(Exception):
    """What makes a model unbounded."""


def beyond_bounds(content: bytes) -> str:
    """Return why the model `content` may take any memory or time, or read other files; empty: it does not."""
    seen = _Walk(content)
    try:
        seen.message(MODEL, 0, len(content), DEPTH_MAX)
    except _Unbounded as wrong:
        return str(wrong)
    except IndexError:
        return BROKEN
    if len(content) - seen.weights > STRUCTURE_BYTES_MAX:
        return f"has more than {STRUCTURE_BYTES_MAX} bytes beside its weights"
    return ""


class _Walk:
    """Walk over the fields of a model; `weights` is the length [bytes] of those that hold elements of tensors."""

    def __init__(self, content: bytes) -> None:
        self._content = content
        self._count = self._graphs = 0
        self.weights = 0

    def message(self, kind: int, at: int, end: int, depth: int) -> None:
        """Walk through a message of `kind` from `at` to `end`. Raises _Unbounded, and IndexError where it is cut."""
        if depth == 0:
            raise _Unbounded(f"has graphs more than {DEPTH_MAX // 3} deep in each other")
        nested, refused = NESTED.get(kind, {}), REFUSED.get(kind, {})
        graphs, operators = self._graphs, set[bytes]()
        self._graphs += kind == GRAPH
        for number, wire, start, stop in self._fields(at, end):
            if number in refused:
                raise _Unbounded(refused[number])
            if kind == TENSOR:
                self._tensor(number, wire, start, stop)
            elif wire == BYTES and number in nested:
                self.message(nested[number], start, stop, depth - 1)
            elif kind == NODE and number == OP_TYPE:
                operators.add(self._content[start:stop])
        if kind == NODE and self._graphs > graphs and operators != {b"If"}:  # Loop, Scan, SequenceMap, BeamSearch
            raise _Unbounded("may repeat a part without a bound (a node with a graph in it that is no If)")

    def _tensor(self, number: int, wire: int, start: int, stop: int) -> None:
        if number in (EXTERNAL_DATA, DATA_LOCATION) and (wire == BYTES or self._content[start:stop] != b"\0"):
            raise _Unbounded("has weights in another file")
        if number in WEIGHTS and wire == BYTES:
            self.weights += stop - start

    def _fields(self, at: int, end: int) -> Iterator[tuple[int, int, int, int]]:
        """Yield number, wire type, start and end of the content of each field (protobuf encoding)."""
        while at < end:
            self._count += 1
            if self._count > FIELDS_MAX:
                raise _Unbounded(f"has more than {FIELDS_MAX} fields beside its weights")
            tag, at = self._varint(at)
            wire, start = tag & 7, at
            if wire == VARINT:
                at = self._varint(at)[1]
            elif wire == BYTES:
                length, start = self._varint(at)
                at = start + length
            elif wire in FIXED:
                at += FIXED[wire]
            else:
                raise _Unbounded(BROKEN)
            if at > end:
                raise _Unbounded(BROKEN)
            yield tag >> 3, wire, start, at

    def _varint(self, at: int) -> tuple[int, int]:
        """Return the number at `at`, and where it ends."""
        value, shift = 0, 0
        while True:
            byte = self._content[at]
            value |= (byte & 0x7F) << shift
            at, shift = at + 1, shift + 7
            if byte < 0x80:
                return value, at
            if shift > 63:
                raise _Unbounded(BROKEN)
