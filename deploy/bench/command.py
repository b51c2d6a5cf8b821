"""`lfa bench NAME`: one module a name in this package, each with `run(as_json) -> exit code`."""

from __future__ import annotations

from importlib import import_module
from pkgutil import iter_modules
from typing import Annotated

import typer

import deploy.bench
from protocol.mission import Refused


def command(
    name: Annotated[str, typer.Argument(help="What to measure, such as lidar.")],
    as_json: Annotated[
        bool, typer.Option("--json", help='Print {"rows": [...]}, each with value, bar and ok.')
    ] = False,
) -> int:
    """Exit code 1 when a row does not reach its bar."""
    names = _names()
    if name not in names:
        raise Refused(f"no bench {name!r}: must be one of {', '.join(names)}")
    code: int = import_module(f"deploy.bench.{name}").run(as_json)
    return code


def _names() -> list[str]:
    """The modules of this package that can be run; finding out imports them."""
    modules = (module.name for module in iter_modules(deploy.bench.__path__) if module.name != "command")
    return [name for name in modules if hasattr(import_module(f"deploy.bench.{name}"), "run")]
