"""Train a controller, write it as a model (ONNX), and drive by it, as `lfa sim --controller learned.onnx` does."""

from math import cos, sin

import numpy as np
from onnx import TensorProto, helper, numpy_helper, save

from lfa.agents.following.onnx_policy import FIELDS
from lfa.agents.following.plugin import add_controller_file
from lfa.deploy.simulate import run


def teacher(ahead: float, left: float, speed: float, turn: float, turn_rate: float) -> tuple[float, float]:
    """Return the twist to imitate: drive with the slot, close the gap ahead, steer to the slot's line and heading."""
    v = speed * cos(turn) + 1.5 * ahead
    return v, turn_rate + 3.0 * sin(turn) + 4.0 * v * left


chance = np.random.default_rng(7)
seen = chance.normal(0.0, 0.2, (5000, len(FIELDS))).astype(np.float32)
seen[:, FIELDS.index("slot_ahead_mps")] += 0.5  # m/s: as fast as the team drives
names = ("slot_ahead_m", "slot_left_m", "slot_ahead_mps", "slot_turn_rad", "slot_turn_radps")
columns = [seen[:, FIELDS.index(name)] for name in names]
wanted = np.array([teacher(*values) for values in zip(*columns, strict=True)])
weights, *_ = np.linalg.lstsq(seen, wanted, rcond=None)
print(f"imitates its teacher to {np.sqrt(np.mean((seen @ weights - wanted) ** 2)):.2f} (rms of m/s and rad/s)")

given = helper.make_tensor_value_info("seen", TensorProto.FLOAT, [1, len(FIELDS)])
answered = helper.make_tensor_value_info("twist", TensorProto.FLOAT, [1, 2])
layer = helper.make_node("MatMul", ["seen", "weights"], ["twist"])
known = [numpy_helper.from_array(weights.astype(np.float32), "weights")]
graph = helper.make_graph([layer], "learned", [given], [answered], known)
save(helper.make_model(graph, ir_version=10, opset_imports=[helper.make_opsetid("", 17)]), "learned.onnx")

chosen = f"mission.following.controller={add_controller_file('learned.onnx')}"
done = run("straight", robots=3, set=[chosen, "mission.leading.route_m=[[2.0, 0.0], [4.0, 1.0], [6.0, 1.0]]"])
worst_m = max(robot.distance_error_rms_m or 0.0 for robot in done.summary.robots)
print(f"{done.summary.outcome}, distance error of the worst follower {1000.0 * worst_m:.0f} mm (rms)")
