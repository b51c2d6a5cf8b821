"""All small faults that can be put into one source file: comparisons, signs, logic, numbers, and dropped statements."""

from __future__ import annotations

import ast
import copy
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

COMPARE: dict[type[ast.AST], type[ast.cmpop]] = {
    ast.Lt: ast.GtE, ast.GtE: ast.Lt, ast.Gt: ast.LtE, ast.LtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In,
}  # fmt: skip
ARITHMETIC: dict[type[ast.AST], type[ast.operator]] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult,
}  # fmt: skip
CALLS = {"min": "max", "max": "min", "any": "all", "all": "any"}
Function = ast.FunctionDef | ast.AsyncFunctionDef


class Mutant(NamedTuple):
    """One fault: where it is, the statement there before and after, and how to find it again in the parsed file."""

    line: int
    lines: frozenset[int]
    """A test that runs none of these lines cannot notice."""
    function: str
    """Qualified name of the innermost function around it, such as `Follower.step`."""
    before: str
    after: str
    place: int
    """Number of the changed node among those of the file."""
    change: int
    """Number of the change among those of its node."""

    def __str__(self) -> str:
        return f"{self.line}: {self.name}"

    @property
    def name(self) -> str:
        """What the list of equivalent faults calls it: line numbers move, names do not."""
        return f"{self.function}: {self.before} -> {self.after}"


class Place(NamedTuple):
    """One statement or expression of a function's body."""

    function: str
    in_init: bool
    """What `__init__` sets is not dropped: any use of it would notice."""
    statement: ast.stmt
    node: ast.stmt | ast.expr


def mutants(source: str) -> Iterator[Mutant]:
    """Yield every mutant of `source`, in the order of its functions."""
    for place, (function, in_init, statement, node) in enumerate(_places(ast.parse(source))):
        for number, change in enumerate(_changes(node, droppable=not in_init)):
            twin = copy.deepcopy(statement)
            change(_same_in(twin, statement, node))
            before, after = (ast.unparse(code).partition("\n")[0] for code in (statement, twin))
            yield Mutant(node.lineno, _lines(statement, node), function, before, after, place, number)


def planted(source: str, mutant: Mutant) -> ast.Module:
    """Return the tree of `source` with the fault in it."""
    tree = ast.parse(source)
    _, in_init, _, node = list(_places(tree))[mutant.place]
    list(_changes(node, droppable=not in_init))[mutant.change](node)
    return ast.fix_missing_locations(tree)


def _same_in(twin: ast.stmt, statement: ast.stmt, node: ast.AST) -> ast.AST:
    """Return what `node` of `statement` is in its copy `twin`."""
    return next(copied for copied, mine in zip(ast.walk(twin), ast.walk(statement), strict=True) if mine is node)


def _lines(statement: ast.stmt, node: ast.stmt | ast.expr) -> frozenset[int]:
    """Return the lines of a statement without those of the statements inside it, and the lines of `node`."""
    inside = getattr(statement, "body", None) or getattr(statement, "cases", None)
    first = inside[0].lineno if inside and hasattr(inside[0], "lineno") else statement.lineno + 1 if inside else None
    last = max(statement.lineno, first - 1) if first is not None else statement.end_lineno or statement.lineno
    own = range(node.lineno, (node.end_lineno or node.lineno) + 1) if isinstance(node, ast.expr) else ()
    return frozenset((*range(statement.lineno, last + 1), *own))


def _places(tree: ast.Module) -> Iterator[Place]:
    """Yield the code of function bodies; annotations, docstrings, defaults and words of messages are none here."""
    for name, function in _functions(tree, ""):
        for statement in function.body:
            if isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant):
                continue
            for inner, node in _below(statement, statement):
                yield Place(name, function.name == "__init__" and node in function.body, inner, node)


def _functions(node: ast.AST, outer: str) -> Iterator[tuple[str, Function]]:
    for child in ast.iter_child_nodes(node):
        if isinstance(child, Function | ast.ClassDef):
            name = f"{outer}{child.name}"
            if isinstance(child, Function):
                yield name, child
            yield from _functions(child, f"{name}.")
        else:
            yield from _functions(child, outer)


def _below(node: ast.AST, statement: ast.stmt) -> Iterator[tuple[ast.stmt, ast.stmt | ast.expr]]:
    """Yield each node below with the statement that it is part of."""
    if isinstance(node, Function | ast.Raise | ast.Assert | ast.JoinedStr):
        return  # a function inside is visited by itself; what only words a message is no behaviour
    if isinstance(node, ast.stmt):
        statement = node
    if isinstance(node, ast.stmt | ast.expr):
        yield statement, node
    for name, value in ast.iter_fields(node):
        if name != "annotation":
            for child in value if isinstance(value, list) else [value]:
                if isinstance(child, ast.AST):
                    yield from _below(child, statement)


def _changes(node: ast.AST, *, droppable: bool) -> Iterator[Callable[[Any], None]]:
    """Yield the faults for one node, each as a function that puts it into the node, or into a copy of it."""
    match node:
        case ast.Compare(ops=[op]) if type(op) in COMPARE:
            yield lambda n: _set(n, ops=[COMPARE[type(op)]()])
        case ast.BoolOp(op=op):
            yield lambda n: _set(n, op=ast.Or() if isinstance(op, ast.And) else ast.And())
        case ast.UnaryOp(op=ast.Not() | ast.USub()):
            yield lambda n: _become(n, n.operand)
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
    node.__class__ = other.__class__
    node.__dict__ = other.__dict__
