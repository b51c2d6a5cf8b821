"""A learned controller: what its model is given, that it drives as any controller, and that other files are refused."""

from __future__ import annotations

from math import pi
from pathlib import Path

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper, numpy_helper

from lfa.agents.config import DEFAULT
from lfa.agents.following.controller import CONTROLLERS, Reference
from lfa.agents.following.onnx_policy import FIELDS, seen
from lfa.agents.following.plugin import add_controller_file, make_controller
from lfa.deploy.own_code import OwnFile, chosen_files, options_of
from lfa.deploy.run.simulate import measure
from lfa.protocol.errors import Refused
from lfa.protocol.geometry import Pose2D, Twist
from lfa.protocol.mission import Following, Limits
from lfa.world.description.load import load

SLOT = Reference(1.0, 2.0, 0.0, 0.5, pi / 2, 0.1, 1, Pose2D(1.0, 3.0, pi / 2), Twist(0.5, 0.0), 1.0, 0.0, True)
FACING_IT = Pose2D(1.0, 1.5, pi / 2)


@pytest.fixture(autouse=True)
def _no_controllers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(CONTROLLERS, "_added", {})
    monkeypatch.setattr(CONTROLLERS, "_files", {})


def model(path: Path, weights: np.ndarray, kind: int = TensorProto.FLOAT, answers: int = 1) -> str:
    """Write a linear model, and return its path as a text."""
    into, out = weights.shape
    graph = helper.make_graph(
        [helper.make_node("MatMul", ["seen", "weights"], [f"twist{n}"]) for n in range(answers)],
        "linear",
        [helper.make_tensor_value_info("seen", kind, [1, into])],
        [helper.make_tensor_value_info(f"twist{n}", kind, [1, out]) for n in range(answers)],
        [numpy_helper.from_array(weights, "weights")],
    )
    onnx.save(helper.make_model(graph, ir_version=10, opset_imports=[helper.make_opsetid("", 17)]), path)
    return str(path)


def weights(**gains: tuple[float, float]) -> np.ndarray:
    """Return the weights of a model: for each field its share in forward speed and in yaw rate."""
    return np.array([gains.get(field, (0.0, 0.0)) for field in FIELDS], np.float32)


GOOD = {
    "slot_ahead_m": (1.5, 0.0), "slot_ahead_mps": (1.0, 0.0), "slot_left_m": (0.0, 2.0), "slot_turn_rad": (0.0, 3.0),
    "slot_turn_radps": (0.0, 1.0),
}  # fmt: skip


def test_a_model_is_given_what_its_robot_measures_as_seen_from_itself() -> None:
    given = dict(zip(FIELDS, seen(SLOT, FACING_IT, Twist(0.4, -0.1)), strict=True))
    assert given == pytest.approx({
        "slot_ahead_m": 0.5, "slot_left_m": 0.0, "slot_ahead_mps": 0.5, "slot_left_mps": 0.0, "slot_turn_rad": 0.0,
        "slot_turn_radps": 0.1, "direction": 1.0, "own_mps": 0.4, "own_radps": -0.1,
        "predecessor_ahead_m": 1.5, "predecessor_left_m": 0.0,
    })  # fmt: skip


def test_the_twist_is_what_the_model_answers(tmp_path: Path) -> None:
    name = add_controller_file(model(tmp_path / "own.onnx", weights(**GOOD)))
    controller = make_controller(Following(controller=name), DEFAULT, Limits())
    wanted = controller.step(SLOT, FACING_IT, Twist(), 0.02)
    assert (wanted.linear_x, wanted.angular_z) == pytest.approx((1.5 * 0.5 + 0.5, 0.1), abs=1e-6)


def test_other_processes_load_the_model_from_its_path(tmp_path: Path) -> None:
    path = model(tmp_path / "own.onnx", weights(**GOOD))
    scenario = load("straight", (f"mission.following.controller={add_controller_file(path)}",))
    assert chosen_files(scenario) == (OwnFile("controller", path),)
    assert chosen_files(scenario)[0].path == Path(path)
    assert options_of(chosen_files(scenario), ("controller",)) == ["--controller", path]


def test_a_model_that_wants_to_ram_its_predecessor_is_held_by_the_braking_behind_it(tmp_path: Path) -> None:
    ram = weights(direction=(9.0, 0.0), predecessor_left_m=(0.0, 9.0))
    name = add_controller_file(model(tmp_path / "ram.onnx", ram))
    settings = (f"mission.following.controller={name}", "mission.leading.route_m=[[4.0, 0.0]]", "time_limit_s=15")
    ended = measure(load("straight", settings, 2), 1)
    assert [robot.contacts for robot in ended.summary.robots] == [0, 0]


@pytest.mark.parametrize(
    ("write", "says"),
    [
        (lambda path: None, "No such file or directory"),
        (lambda path: path.mkdir(), "Is a directory"),
        (lambda path: path.write_bytes(b""), "No graph was found in the protobuf"),
        (lambda path: path.write_bytes(b"no model"), "Failed to load model because protobuf parsing failed"),
        (lambda path: model(path, np.zeros((4, 2), np.float32)), "takes shape [1, 4]"),
        (lambda path: model(path, np.zeros((11, 3), np.float32)), "answers with shape [1, 3]"),
        (lambda path: model(path, weights(), answers=2), "1 inputs and 2 outputs"),
        (lambda path: model(path, np.zeros((11, 2)), TensorProto.DOUBLE), "tensor(double) to tensor(double)"),
        (lambda path: model(path, weights(own_mps=(np.nan, 0.0))), "a number that is not finite"),
    ],
)  # fmt: skip
def test_what_is_no_model_of_a_controller_is_refused_in_one_line(tmp_path: Path, write, says: str) -> None:  # type: ignore[no-untyped-def]
    path = tmp_path / "bad.onnx"
    write(path)
    with pytest.raises(Refused) as refused:
        add_controller_file(str(path))
    text = str(refused.value)
    assert text.startswith(f"--controller {path}: ")
    assert says in text and "must be a model (ONNX) from float tensor [1, 11] to float tensor [1, 2]" in text
    assert "\n" not in text


def test_without_the_extra_the_line_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "onnxruntime", None)
    with pytest.raises(Refused, match=r"needs onnxruntime: install with: pip install 'lfa\[onnx\]'"):
        add_controller_file(str(tmp_path / "own.onnx"))
