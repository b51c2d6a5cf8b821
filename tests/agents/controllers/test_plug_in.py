"""The controller that the README shows is found as a plug-in and keeps a follower near its slot."""

from __future__ import annotations

import re
import sys
from importlib.metadata import EntryPoint, EntryPoints
from pathlib import Path
from types import ModuleType

import pytest

import lfa.agents.controllers
from lfa.agents.following import controller
from lfa.agents.following.controller import find_controller
from lfa.deploy.bench.harness.chain import Chain, Setup
from lfa.protocol.errors import Refused
from lfa.protocol.geometry import Twist
from lfa.protocol.messages.team import Slot

README = Path(lfa.agents.controllers.__file__).parent / "README.md"


def test_the_readmes_controller_follows_a_bend(monkeypatch: pytest.MonkeyPatch) -> None:
    code = re.search(r"```python\n(.*?)```", README.read_text(), re.DOTALL)
    assert code is not None
    module = ModuleType("my_package")
    exec(code[1], module.__dict__)
    monkeypatch.setitem(sys.modules, "my_package", module)
    point = EntryPoint("simple", "my_package:Simple", "lfa.controllers")
    monkeypatch.setattr("importlib.metadata.entry_points", lambda group: EntryPoints([point]))
    assert find_controller("simple") is module.Simple
    chain = Chain(Setup((Slot(2, 1.2, 2.0944),), controller="simple"))
    for step in range(2000):
        chain.step(Twist(min(0.5, 0.01 * step), 0.05))
    assert chain.errors(0).slot_m < 0.05
    assert abs(chain.errors(0).heading_rad) < 0.1


def test_a_scripts_own_controller_is_found_by_its_name_and_replaces_no_default(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(controller.CONTROLLERS, "_added", {})
    with pytest.raises(Refused, match="must be one of"):
        find_controller("mine")
    controller.add_controller("mine", controller.Law)
    assert find_controller("mine") is controller.Law
    with pytest.raises(Refused, match="cannot be replaced"):
        controller.add_controller("law", controller.Law)
