"""A user's own controller: its parameters are typed by it, and its faults are one line with file and line number."""

from __future__ import annotations

from math import pi
from pathlib import Path

import pytest
from msgspec import Struct

from lfa.agents.config import DEFAULT
from lfa.agents.controllers.headway import Headway
from lfa.agents.following.checked_controller import CheckedController
from lfa.agents.following.controller import CONTROLLERS, Reference, add_controller
from lfa.agents.following.follower import Follower
from lfa.agents.following.plugin import add_controller_file, make_controller
from lfa.agents.following.predecessor import Sighting
from lfa.agents.formation.pose_history import PoseHistory
from lfa.protocol.errors import Refused
from lfa.protocol.geometry import STILL, Pose2D, Twist
from lfa.protocol.messages.team import Slot
from lfa.protocol.mission import Following, Limits, Parameter

CODE = """
from lfa.protocol.geometry import Twist

class Own:
    def __init__(self, gains, limits):
        self.left = 3

    def reset(self, own_pose, own_twist):
        pass

    def step(self, reference, own_pose, own_twist, dt):
        self.left -= 1
        if self.left > 0:
            return Twist(0.1, 0.0)
        {ends}
"""


@pytest.mark.parametrize(
    ("ends", "says"),
    [
        ("raise ZeroDivisionError('by zero')", "own.py:15: ZeroDivisionError: by zero"),
        ("return 0.1, 0.2", "own.py:11: step returned a value of type tuple, must be a Twist of finite numbers"),
        ("return Twist(float('nan'), 0.0)", "own.py:11: step returned Twist(nan, 0.0), must be"),
        ("return Twist('fast', 0.0)", "own.py:11: step returned Twist(fast, 0.0), must be"),
        ("return None", "own.py:11: step returned nothing, must be"),
        ("return Twist(10**400, 0.0)", "own.py:11: step returned Twist(1000"),
        ("return reference.no_such_field", "own.py:15: AttributeError: "),
        ("import json; json.loads('{')", "own.py:15: JSONDecodeError: "),
        ("raise SystemExit(0)", "own.py:15: SystemExit: 0"),
    ],
)
def test_a_fault_of_a_controller_stops_its_robot_and_is_a_line_with_file_and_line(
    tmp_path: Path, ends: str, says: str
) -> None:
    (tmp_path / "own.py").write_text(CODE.format(ends=ends))
    name = add_controller_file(f"{tmp_path}/own.py:Own")
    assert CONTROLLERS.file_of(name) == f"{tmp_path}/own.py:Own"
    made = make_controller(Following(controller=name), DEFAULT, Limits())
    follower = Follower(DEFAULT, Limits(), made, name=name)
    ahead = Sighting(1, 0, Pose2D(1.5, 0.0, 0.0), Twist(0.2, 0.0), 0.0, 0.0, 0.0, PoseHistory(1.0))
    driven = [follower.step(ahead, Slot(2, 1.2, pi), Pose2D(), STILL) for _ in range(60)]
    assert driven[1].linear_x > 0.0
    assert driven[-1] == STILL
    assert follower.failure is not None
    assert follower.failure.startswith(f"controller own.py:Own: {says}")


@pytest.mark.parametrize("method", ["step", "reset"])
def test_a_method_that_takes_other_arguments_is_told_where_it_starts(tmp_path: Path, method: str) -> None:
    code = CODE.format(ends="")
    start = f"def {method}(self"
    (tmp_path / "own.py").write_text(code.replace(start, f"{start}, more"))
    name = add_controller_file(f"{tmp_path}/own.py:Own")
    made = CheckedController(make_controller(Following(controller=name), DEFAULT, Limits()), name)
    made.reset(Pose2D(), STILL)
    made.step(Reference(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1, Pose2D(), STILL, 1.2, 0.0, True), Pose2D(), STILL, 0.02)
    line = next(n for n, text in enumerate(code.splitlines(), 1) if start in text)
    assert made.failure is not None
    assert made.failure.startswith(f"controller own.py:Own: own.py:{line}: TypeError: ")


@pytest.mark.parametrize(
    ("takes", "says"),
    [
        ("self", "own.py:4: TypeError: "),
        ("self, gains, limits, *, more", "own.py:4: TypeError: "),
        ("self, gains, limits, x=__import__('sys').exit", "own.py:6: SystemExit: 3"),
    ],
)
def test_a_controller_that_cannot_be_made_is_refused_with_its_place(tmp_path: Path, takes: str, says: str) -> None:
    own = CODE.format(ends="").replace("self, gains, limits", takes).replace("self.left = 3", "self.left = 3; x(3)")
    (tmp_path / "own.py").write_text(own)
    name = add_controller_file(f"{tmp_path}/own.py:Own")
    with pytest.raises(Refused) as refused:
        make_controller(Following(controller=name), DEFAULT, Limits())
    assert f"cannot be made: {says}" in str(refused.value)


@pytest.mark.parametrize(
    ("parameters", "says"),
    [
        ({"headway_s": "long"}, r"parameters\.headway_s = long: Expected `float`"),
        ({"headway": 1.0}, r"parameters\.headway: no such parameter of headway: known are headway_s"),
    ],
)
def test_a_controllers_own_type_judges_its_parameters(parameters: dict[str, Parameter], says: str) -> None:
    with pytest.raises(Refused, match=says):
        make_controller(Following(controller="headway", parameters=parameters), DEFAULT, Limits())


def test_a_parameter_reaches_the_controller() -> None:
    class Seen(Headway):
        class Parameters(Struct):
            headway_s: float = 0.3

        def step(self, reference: Reference, own_pose: Pose2D, own_twist: Twist, dt: float) -> Twist:
            return Twist(self._headway_s, 0.0)

    add_controller("seen", Seen)
    made = make_controller(Following(controller="seen", parameters={"headway_s": 0.7}), DEFAULT, Limits())
    reference = Reference(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1, Pose2D(), STILL, 1.2, 0.0, True)
    assert made.step(reference, Pose2D(), STILL, 0.02) == Twist(0.7, 0.0)


def test_a_controller_without_parameters_refuses_them() -> None:
    with pytest.raises(Refused, match=r"parameters = \{k = 2\.0\}: controller law has none"):
        make_controller(Following(parameters={"k": 2.0}), DEFAULT, Limits())


@pytest.mark.parametrize(
    ("text", "code", "says"),
    [
        ("none.py:Own", None, "no such file, must be FILE.py:Class"),
        ("own.py:Other", "class Own: pass", "has no class 'Other'"),
        ("own.py:Own", "class Own\n    pass", "own.py:1: SyntaxError"),
        ("own.py:Own", "x = 1\nraise ValueError('no')", "own.py:2: ValueError: no"),
        ("own.py:Own", "import sys\nsys.exit(0)", "own.py:2: SystemExit: 0"),
    ],
)
def test_a_file_without_a_controller_is_refused_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str, code: str | None, says: str
) -> None:
    monkeypatch.chdir(tmp_path)
    if code is not None:
        (tmp_path / "own.py").write_text(code)
    with pytest.raises(Refused) as refused:
        add_controller_file(text)
    assert says in str(refused.value)
    assert len(refused.value.lines) == 1
