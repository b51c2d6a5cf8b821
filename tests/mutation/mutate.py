"""All small faults that can be put into one source file: comparisons, signs, logic, numbers, and dropped statements."""

from __future__ import annotations

import ast
import copy
from collections.abc import Callable, Iterator
from typing import NamedTuple

COMPARE: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.GtE, ast.GtE: ast.Lt, ast.Gt: ast.LtE, ast.LtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In,
}  # fmt: skip
ARITHMETIC: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult,
}  # fmt: skip
CALLS = {"min": "max", "max": "min", "any": "all", "all": "any"}


class Mutant(NamedTuple):
    """One fault: its line, the code there before and after, and the whole changed file."""

    line: int
    before: str
    after: str
    tree: ast.Module

    def __str__(self) -> str:
        return f"{self.line}: {self.before} -> {self.after}"


def mutants(source: str) -> Iterator[Mutant]:
    """Yield every mutant of `source`, in the order of its lines."""
    tree = ast.parse(source)
    first = {id(n) for f in ast.walk(tree) if isinstance(f, ast.FunctionDef) and f.name == "__init__" for n in f.body}
    for place, node in enumerate(list(_code(tree))):
        for change in _changes(node, droppable=id(node) not in first):
            changed = copy.deepcopy(tree)
            twin = list(_code(changed))[place]
            change(twin)
            after = ast.unparse(twin)
            yield Mutant(node.lineno, _first_line(ast.unparse(node)), _first_line(after), changed)


def _code(tree: ast.Module) -> Iterator[ast.stmt | ast.expr]:
    """Yield statements and expressions of function bodies; annotations, docstrings and defaults are no code here."""
    for function in ast.walk(tree):
        if isinstance(function, ast.FunctionDef):
            for statement in function.body:
                if isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant):
                    continue
                yield from _below(statement)


def _below(node: ast.AST) -> Iterator[ast.stmt | ast.expr]:
    if isinstance(node, ast.FunctionDef | ast.Raise | ast.Assert | ast.JoinedStr):
        return  # a function inside is visited by itself; what only words a message is no behaviour
    if isinstance(node, ast.stmt | ast.expr):
        yield node
    for name, value in ast.iter_fields(node):
        if name != "annotation":
            for child in value if isinstance(value, list) else [value]:
                if isinstance(child, ast.AST):
                    yield from _below(child)


def _changes(node: ast.AST, *, droppable: bool) -> Iterator[Callable[[ast.AST], None]]:
    """Yield the faults for one node, each as a function that puts it into a copy of the node.

    What `__init__` sets is not `droppable`: any use of it would notice.
    """
    match node:
        case ast.Compare(ops=[op]) if type(op) in COMPARE:
            yield lambda n: _set(n, ops=[COMPARE[type(op)]()])
        case ast.BoolOp(op=op):
            yield lambda n: _set(n, op=ast.Or() if isinstance(op, ast.And) else ast.And())
        case ast.UnaryOp(op=ast.Not() | ast.USub()):
            yield lambda n: _become(n, n.operand)  # type: ignore[attr-defined]
        case ast.BinOp(op=op) | ast.AugAssign(op=op) if type(op) in ARITHMETIC:
            yield lambda n: _set(n, op=ARITHMETIC[type(op)]())
        case ast.Constant(value=bool(value)):
            yield lambda n: _set(n, value=not value)
        case ast.Constant(value=int(value)):
            yield lambda n: _set(n, value=value + 1)
        case ast.Call(func=ast.Name(id=name)) if name in CALLS:
            yield lambda n: _set(n, func=ast.Name(CALLS[name], ast.Load()))
    if droppable and _may_be_dropped(node):
        yield lambda n: _become(n, ast.Pass())


def _may_be_dropped(node: ast.AST) -> bool:
    """Return True for calls without a result and for changes of state; a dropped local would only be an error."""
    targets = node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AugAssign) else []
    if targets:
        return all(isinstance(target, ast.Attribute | ast.Subscript) for target in targets)
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Call)


def _set(node: ast.AST, **fields: object) -> None:
    for name, value in fields.items():
        setattr(node, name, value)
    ast.fix_missing_locations(node)


def _become(node: ast.AST, other: ast.AST) -> None:
    """Turn `node` into `other` in place, for whoever holds it."""
    ast.copy_location(other, node)
    node.__class__ = other.__class__  # type: ignore[assignment]
    node.__dict__ = other.__dict__


def _first_line(code: str) -> str:
    return code.partition("\n")[0]
