"""Making of the controller that a mission chooses, and loading of one from a file `FILE.py:Class` or `FILE.onnx`.

A controller with parameters of its own names their types in a `Struct` called `Parameters`, and gets one as its third
argument. Code is loaded only by the name of an installed package or from the command line, never because a message
or a scenario names a file.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from lfa.agents.config import Gains
from lfa.agents.following.controller import CONTROLLERS, Controller, MakeController, find_controller
from lfa.protocol.errors import Refused
from lfa.protocol.mission import Following, Limits, Parameter
from lfa.protocol.plug_in import FAULTS, converted, error_text, is_file, parameters_of


def add_controller_file(text: str) -> str:
    """Load the controller that `FILE.py:Class` or `FILE.onnx` names, and return the name by which a mission chooses it.

    Any other text is the name of an installed controller, and returned as it is. Raise `Refused` with one line for a
    file that cannot be read or run, that has no such class, or is no model of a controller.
    """
    if is_model(text):
        path = Path(text).absolute()
        CONTROLLERS.add(path.name, _model(path, f"{CONTROLLERS.option}{text}"), str(path))
        return path.name
    if is_file(text):
        return CONTROLLERS.add_file(text)
    find_controller(text)
    return text


def is_model(text: str) -> bool:
    """Return True for the file of a learned controller, `FILE.onnx`, whether or not there is such a file."""
    return text.endswith(".onnx")


def _model(path: Path, where: str) -> MakeController:
    from lfa.agents.following.onnx_policy import OnnxModel  # for a robot that drives by one

    return OnnxModel(path, where)


def make_controller(following: Following, gains: Gains, limits: Limits) -> Controller:
    """Return the controller that the mission chooses, with its parameters.

    Raise `Refused` for an unknown controller, a parameter that it has not or of another type, and for a class that
    raises.
    """
    make: Any = find_controller(following.controller)
    kind = parameters_of(make)
    if kind is None and following.parameters:
        raise Refused(f"parameters = {{{_names(following.parameters)}}}: controller {following.controller} has none")
    try:
        made: Controller = (
            make(gains, limits)
            if kind is None
            else make(gains, limits, converted(following.parameters, kind, following.controller))
        )
    except Refused:
        raise
    except FAULTS as error:
        raise Refused(f"controller = {following.controller}: cannot be made: {error_text(error, make)}") from None
    if not (callable(getattr(made, "step", None)) and callable(getattr(made, "reset", None))):
        raise Refused(f"controller = {following.controller}: must be a class with the methods reset and step")
    return made


def _names(parameters: dict[str, Parameter]) -> str:
    return ", ".join(f"{name} = {value}" for name, value in parameters.items())
