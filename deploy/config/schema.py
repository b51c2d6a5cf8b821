"""`lfa schema`: print every key of a scenario or a fleet file, as a JSON schema for editors or as a table.

The description of a key is the string below its field in the source; it is read from there.
"""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Iterator
from functools import cache
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

import msgspec
import typer
from msgspec import NODEFAULT, UNSET, Struct, UnsetType
from msgspec.structs import FieldInfo, fields

from lfa.agents.following.controller import CONTROLLERS, find_controller
from lfa.deploy.fleet.plan.fleet_file import FleetFile
from lfa.deploy.terminal_text import print_visible
from lfa.protocol.plug_in import parameters_of
from lfa.world.description.load import Scenario

PARAMETERS = "mission.following.parameters"
UNITS = {
    "m": "m", "s": "s", "ms": "ms", "rad": "rad", "mps": "m/s", "mps2": "m/s²", "radps": "rad/s", "radps2": "rad/s²",
    "hz": "Hz", "kg": "kg", "n": "N",
}  # fmt: skip


class Key(Struct, frozen=True):
    """One key of a scenario or fleet file."""

    path: str
    type: str
    unit: str
    default: str
    """Default value in TOML; empty if the key is required."""
    text: str


def command(
    markdown: Annotated[
        bool, typer.Option("--markdown", help="Print a Markdown table instead of a JSON schema.")
    ] = False,
    fleet: Annotated[
        bool, typer.Option("--fleet", help="Describe a fleet file (lfa up) instead of a scenario.")
    ] = False,
) -> int:
    kind = FleetFile if fleet else Scenario
    print_visible(
        table(kind) if markdown else msgspec.json.format(msgspec.json.encode(schema(kind)), indent=1).decode()
    )
    return 0


def schema(kind: type[Struct] = Scenario) -> dict[str, Any]:
    """Return the JSON schema of a scenario file, or of another `kind` of file, with the descriptions of the keys."""
    made = msgspec.json.schema(kind)
    for name, struct in {kind.__name__: kind for kind in _structs(kind)}.items():
        properties = made["$defs"].get(name, {}).get("properties", {})
        for field in fields(struct):
            text = _texts(struct).get(field.name)
            if text and field.encode_name in properties:
                properties[field.encode_name]["description"] = text
    made["$defs"][kind.__name__]["properties"].pop("name", None)
    if kind is Scenario:
        own = {key.path.rpartition(".")[2]: key.text for key in _controller_keys(PARAMETERS)}
        described = {name: {"description": text} for name, text in own.items()}
        made["$defs"]["Following"]["properties"]["parameters"]["properties"] = described
    title = f"lfa {'scenario' if kind is Scenario else 'fleet'}"
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": title, **made}


def documented(kind: type[Struct] = Scenario) -> list[Key]:
    """Return every key, in the order of the types; `[]` stands for an item of a list, `NAME` for one of a table."""
    return list(_keys(kind, ""))


def table(kind: type[Struct] = Scenario) -> str:
    """Return all keys of `kind` as a Markdown table."""
    rows = ["| key | type | unit | default | what |", "| --- | --- | --- | --- | --- |"]
    rows += [
        f"| `{key.path}` | {_cell(key.type)} | {key.unit} | {f'`{_cell(key.default)}`' if key.default else 'required'} "
        f"| {_cell(key.text)} |"
        for key in documented(kind)
    ]
    return "\n".join(rows)


def _keys(struct: type[Struct], where: str) -> Iterator[Key]:
    hints = get_type_hints(struct)
    for field in fields(struct):
        path, kind = f"{where}{field.encode_name}", hints[field.name]
        if path == "name":
            continue
        inner = next(_structs_of(kind), None)
        if inner is None:
            if path == PARAMETERS:
                yield from _controller_keys(path)
            yield Key(path, _type(kind), _unit(field.encode_name), _default(field), _texts(struct).get(field.name, ""))
        else:
            one = {tuple: "[]", dict: ".NAME"}.get(get_origin(kind), "")
            yield from _keys(inner, f"{path}{one}.")


def _controller_keys(path: str) -> Iterator[Key]:
    """Yield the parameters of each installed controller that has some."""
    for name, kind in controller_parameters().items():
        for key in _keys(kind, f"{path}."):
            yield msgspec.structs.replace(key, text=f"With controller `{name}`. {key.text}".rstrip())


def controller_parameters() -> dict[str, type[Struct]]:
    """Return the type of the parameters of each installed controller that has some, by name."""
    kinds = {name: parameters_of(find_controller(name)) for name in CONTROLLERS.installed()}
    return {name: kind for name, kind in kinds.items() if kind is not None}


def _structs(struct: type[Struct]) -> Iterator[type[Struct]]:
    yield struct
    for kind in get_type_hints(struct).values():
        for inner in _structs_of(kind):
            yield from _structs(inner)


def _structs_of(kind: Any) -> Iterator[type[Struct]]:
    if isinstance(kind, type) and issubclass(kind, Struct):
        yield kind
    for argument in get_args(kind):
        yield from _structs_of(argument)


@cache  # bounded by the number of types in the program
def _texts(struct: type[Struct]) -> dict[str, str]:
    """Return the string below each field, joined to one line."""
    body = ast.parse(textwrap.dedent(inspect.getsource(struct))).body[0]
    assert isinstance(body, ast.ClassDef)
    found = {}
    for field, after in zip(body.body, body.body[1:], strict=False):
        below = isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
        if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name) and below:
            found[field.target.id] = " ".join(str(after.value.value).split())  # type: ignore[attr-defined]
    return found


def _unit(name: str) -> str:
    """Return the unit from the suffix of a name, such as `separation_m` or `v_max_mps`; empty if it has none."""
    return UNITS.get(name.rpartition("_")[2], "") if "_" in name else ""


def _type(kind: Any) -> str:
    origin, arguments = get_origin(kind), get_args(kind)
    if origin is Literal:
        return " or ".join(f'"{value}"' for value in arguments)
    if origin in (Union, UnionType):
        return " or ".join(_type(argument) for argument in arguments if argument not in (type(None), UnsetType))
    if origin is tuple:
        inner = [_type(argument) for argument in arguments if argument is not Ellipsis]
        return f"list of {inner[0]}" if Ellipsis in arguments else f"[{', '.join(inner)}]"
    if origin is dict:
        return f"table of {_type(arguments[1])}"
    return {float: "number", int: "whole number", str: "text", bool: "true or false"}.get(kind, str(kind))


def _default(field: FieldInfo) -> str:
    value = (
        field.default_factory()
        if field.default is NODEFAULT and field.default_factory is not NODEFAULT
        else field.default
    )
    if value is NODEFAULT:
        return ""
    if value is None or value is UNSET:
        return "not given"
    return msgspec.json.encode(value).decode()


def _cell(text: str) -> str:
    return text.replace("|", "\\|")
