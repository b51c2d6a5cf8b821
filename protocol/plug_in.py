"""Plug-ins: classes of a user's own, by name among the installed entry points of a group, from a file `FILE.py:Class`,
or as a script added them.

A plug-in with parameters of its own names their types in a `Struct` called `Parameters`. Code is loaded only by the
name of an installed package or from the command line, never because a message or a scenario names a file.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any, get_args, get_type_hints

import msgspec
from msgspec import Struct

from lfa.protocol.config_file.mistake import Mistake, RefusedValue
from lfa.protocol.errors import Refused
from lfa.protocol.file_reading import FILE_BYTES_MAX

_TERMINATED = 143
"""Exit code of a process that SIGTERM ends, also while a plug-in is at work."""
FAULTS = (Exception, SystemExit)
"""What a plug-in may raise: one that ends the program has failed, and the program goes on."""
OWN_FILES: set[str] = set()
"""Absolute paths of the plug-ins' files that this process has loaded."""


class PlugIns:
    """Plug-ins of one `kind`, as `sensor`, whose packages name them in the entry points `group`.

    `option` is the word of a command line before a `FILE.py:Class`, with its space; `by_class` says that a class from a
    file is known by its own name, not as `FILE.py:Class`: for names that stand in keys.
    """

    def __init__(self, kind: str, group: str, option: str, *, by_class: bool = False) -> None:
        self._kind, self._group = kind, group
        self.option = option
        self._by_class = by_class
        self._added: dict[str, Any] = {}
        self._files: dict[str, str] = {}

    def add(self, name: str, make: Any, place: str | None = None) -> None:
        """Make `make` the plug-in called `name` in this process: for a script or a notebook that simulates.

        `place` is the absolute path of a file that it was made from, and that other processes load.
        """
        self._added[name] = make
        if place is not None:
            self._files[name] = place

    def add_file(self, text: str) -> str:
        """Load the class that `FILE.py:Class` names, and return the name by which a scenario chooses it.

        A text without `.py:` is the name of a plug-in, and returned as it is. Raise `Refused` with one line for a file
        that cannot be read or run, for one that has no such class, and for an unknown name.
        """
        if not is_file(text):
            self.find(text)
            return text
        file, _, name = text.rpartition(":")
        path = Path(file).absolute()
        make = getattr(_module(path, f"{self.option}{text}"), name, None)
        if not callable(make):
            raise Refused(f"{self.option}{text}: {file} has no class {name!r}, must be FILE.py:Class")
        known_as = name if self._by_class else f"{path.name}:{name}"
        self.add(known_as, make, f"{path}:{name}")
        return known_as

    def file_of(self, name: str) -> str | None:
        """Return the absolute `FILE.py:Class`, or model file, of a plug-in that was added from a file, else None."""
        return self._files.get(name)

    def names(self) -> list[str]:
        """Return the names of all installed and added plug-ins."""
        return sorted({*self._entry_points(), *self._added})

    def installed(self) -> list[str]:
        """Return the names of the installed plug-ins, which other processes find too."""
        return sorted(self._entry_points())

    def find(self, name: str) -> Any:
        """Return the class called `name`. Raise `Refused` for an unknown one, and one whose package cannot be read."""
        if name in self._added:
            return self._added[name]
        points = self._entry_points()
        if name not in points:
            known = ", ".join(self.names()) or "none is installed"
            right = f"one of the entry points {self._group}: {known}; or given by {self.option}FILE.py:Class"
            raise Refused(f"no {self._kind} {name!r}: must be {right}")
        try:
            found = points[name].load()
        except Exception as error:  # noqa: BLE001 - the package of a plug-in may fail in any way
            raise Refused(f"{self._kind} {name}: {points[name].value} cannot be loaded: {error_text(error)}") from None
        if not points[name].module.startswith("lfa."):
            OWN_FILES.add(str(getattr(sys.modules.get(points[name].module), "__file__", "")))
        return found

    def make(self, name: str, given: Mapping[str, Any], key: str, *arguments: Any) -> Any:
        """Return a plug-in made with `arguments` and, if its class has `Parameters`, with `given` as these.

        `key` is the table of a scenario that chooses it. Raise `RefusedValue` for an unknown one, for a parameter that
        it has not or of another type, and for a class that raises.
        """
        try:
            make = self.find(name)
        except Refused as refused:
            raise RefusedValue(Mistake(key, f": {refused}")) from None
        kind = parameters_of(make)
        if kind is None and given:
            mistake = Mistake(f"{key}.parameters.{min(given)}", f": {self._kind} {name} has no parameters")
            raise RefusedValue(mistake)
        try:
            own = () if kind is None else (converted(given, kind, name),)
        except RefusedValue as refused:
            mistake = refused.mistake
            raise RefusedValue(mistake._replace(key=f"{key}.{mistake.key}")) from None
        try:
            return make(*arguments, *own)
        except FAULTS as error:
            says = f": {self._kind} {name} cannot be made: {error_text(error, make)}"
            raise RefusedValue(Mistake(key, says)) from None

    def _entry_points(self) -> dict[str, Any]:
        # Imported here, for a name that is no default: it costs 3 MB of memory.
        from importlib.metadata import entry_points

        return {point.name: point for point in entry_points(group=self._group)}


def is_file(text: str) -> bool:
    """Return True for `FILE.py:Class`, whether or not there is such a file."""
    file, colon, _ = text.rpartition(":")
    return bool(colon) and file.endswith(".py")


def _module(path: Path, where: str) -> Any:
    from importlib.util import module_from_spec, spec_from_file_location

    if not path.is_file():
        raise Refused(f"{where}: no such file, must be FILE.py:Class")
    if path.stat().st_size > FILE_BYTES_MAX:  # a compiler would take it all into memory
        raise Refused(f"{where}: longer than {FILE_BYTES_MAX} bytes, must be a file of Python code")
    # Under a name that no other module has: the types of its classes are looked up there.
    spec = spec_from_file_location(f"own code in {path}", path)
    assert spec is not None and spec.loader is not None
    module = sys.modules[spec.name] = module_from_spec(spec)
    OWN_FILES.add(str(path))
    try:
        spec.loader.exec_module(module)
    except FAULTS as error:
        raise Refused(f"{where}: {error_text(error)}") from None
    return module


def parameters_of(make: Any) -> type[Struct] | None:
    """Return the type of a plug-in's own parameters, None for a plug-in without."""
    kind = getattr(make, "Parameters", None)
    return kind if isinstance(kind, type) and issubclass(kind, Struct) else None


def converted(given: Mapping[str, Any], kind: type[Struct], name: str) -> Struct:
    """Return the parameters `given` to the plug-in `name` as `kind`.

    Raise `RefusedValue` with the parameter and the type that would be right.
    """
    known = {field.encode_name for field in msgspec.structs.fields(kind)}
    unknown = sorted(set(given) - known)
    if unknown:
        right = ", ".join(sorted(known)) or "none"
        raise RefusedValue(Mistake(f"parameters.{unknown[0]}", f": no such parameter of {name}: known are {right}"))
    hints = get_type_hints(kind)
    try:
        return msgspec.convert({name: _as_whole(value, hints.get(name)) for name, value in given.items()}, kind)
    except msgspec.ValidationError as error:
        says, _, place = str(error).partition(" - at `$")
        key = f"parameters{place.rstrip('`')}"
        value = given.get(key.rpartition(".")[2])
        raise RefusedValue(Mistake(key, f"{'' if value is None else f' = {value}'}: {says}")) from None


def _as_whole(value: Any, kind: Any) -> Any:
    """Return `value`, or whole numbers for floats where `kind` takes these only: messages know floats alone."""
    if isinstance(value, float) and value.is_integer() and {int} == {int, float} & {kind, *get_args(kind)}:
        return int(value)
    return [_as_whole(item, kind) for item in value] if isinstance(value, list | tuple) else value


def error_text(error: BaseException, code: Any = None) -> str:
    """Return an exception of a user's own code in one line, with the place in the user's file that led to it.

    `code` is the class, function or method that was called: where it starts is the place of a call that Python refused.
    Raise `error` again if it is the end of this process by a signal.
    """
    import traceback

    if isinstance(error, SystemExit) and error.code == _TERMINATED:
        raise error
    if isinstance(error, SyntaxError):
        return f"{Path(error.filename or '').name}:{error.lineno}: {type(error).__name__}: {error.msg}"
    frames = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames if frame.filename in OWN_FILES]
    where = place_of(code) if code is not None and not own else ""
    if not where and frames:
        last = (own or frames)[-1]
        where = f"{Path(last.filename).name}:{last.lineno}: "
    return f"{where}{type(error).__name__}: {' '.join(str(error).split())}"


def place_of(code: Any) -> str:
    """Return where a class, function or method starts, as `own.py:12: `; empty where Python does not know the place."""
    import inspect

    try:
        return f"{Path(inspect.getsourcefile(code) or '').name}:{inspect.getsourcelines(code)[1]}: "
    except (OSError, TypeError):
        return ""
