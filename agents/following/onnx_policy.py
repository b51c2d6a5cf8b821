"""A learned controller from a model file (ONNX): what a follower measures goes in, the twist that it wants comes out.

The follower treats it as any controller: the drive's limits, stale data, avoidance and the braking before obstacles
stay in force behind it. A model is data: the file names no code, its bytes alone are read, and its memory is bounded.
"""

from __future__ import annotations

from functools import cache
from importlib import import_module
from math import cos, sin
from pathlib import Path
from typing import Any

from lfa.agents.config import Gains
from lfa.agents.following.controller import Reference
from lfa.agents.following.onnx_bounds import beyond_bounds
from lfa.protocol.errors import Refused
from lfa.protocol.file_reading import DamagedFile, read_bytes
from lfa.protocol.geometry import Pose2D, Twist, wrap
from lfa.protocol.mission import Limits

FIELDS = (
    "slot_ahead_m", "slot_left_m", "slot_ahead_mps", "slot_left_mps", "slot_turn_rad", "slot_turn_radps", "direction",
    "own_mps", "own_radps", "predecessor_ahead_m", "predecessor_left_m",
)  # fmt: skip
"""What a model is given, in this order: its slot's place, velocity, heading and turn rate, and its predecessor's place,
all as seen from the robot itself (`base_link`); -1 as direction while the predecessor reverses; its own twist."""
FLOATS, LINE_MAX = "tensor(float)", 120
"""Type of a model's input and output, and the greatest length of what the runtime says of an error."""
OUTPUTS = 2
"""Number of values that a model answers: forward speed [m/s] and yaw rate [rad/s]."""
ARENA_BYTES_MAX = 128 << 20
"""Maximum memory [bytes] of all tensors of a process's models; what asks for more raises, as a failing controller."""


class OnnxModel:
    """Model file, read once; called with gains and limits, as a controller's class, it makes a controller."""

    def __init__(self, path: Path, where: str) -> None:
        """Read the model. Raise `Refused`, its line beginning with `where`, for what is no model of this shape."""
        right = f"must be a model (ONNX) from float tensor [1, {len(FIELDS)}] to float tensor [1, {OUTPUTS}]"
        try:
            runtime, numpy = import_module("onnxruntime"), import_module("numpy")
        except ModuleNotFoundError as error:
            raise Refused(f"{where}: needs {error.name}: install with: pip install 'lfa[onnx]'") from None
        try:
            content = read_bytes(path)
        except OSError as error:
            raise Refused(f"{where}: {error.strerror}, {right}") from None
        except DamagedFile as error:
            raise Refused(f"{where}: {error}, {right}") from None
        self._numpy = numpy
        wrong = beyond_bounds(content) or self._opened(runtime, content)
        if wrong:
            raise Refused(f"{where}: {wrong}, {right}")

    def _opened(self, runtime: Any, content: bytes) -> str:
        """Open a session, and return what a model has otherwise than a controller needs; empty if nothing."""
        _bound_memory(runtime)
        options = runtime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        options.log_severity_level = 4
        options.add_session_config_entry("session.use_env_allocators", "1")
        # What is computed beforehand is outside the bounded memory.
        options.graph_optimization_level = runtime.GraphOptimizationLevel.ORT_DISABLE_ALL
        try:
            self._session: Any = runtime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
            return self._misfit()[:LINE_MAX]
        except Exception as error:  # noqa: BLE001 - the runtime's errors have no class in common
            if "Available memory of" in str(error):
                return f"needs more than {ARENA_BYTES_MAX >> 20} MiB of memory"
            return " ".join(str(error).split()).rpartition(" : ")[2][:LINE_MAX].rstrip(".")

    def _misfit(self) -> str:
        """Return what a model has otherwise than a controller needs; empty if nothing, once it has answered."""
        given, answered = self._session.get_inputs(), self._session.get_outputs()
        if (len(given), len(answered)) != (1, 1):
            return f"{len(given)} inputs and {len(answered)} outputs"
        if (given[0].type, answered[0].type) != (FLOATS, FLOATS):
            return f"{given[0].type} to {answered[0].type}"
        if given[0].shape[-1:] != [len(FIELDS)]:
            return f"takes shape {given[0].shape}"
        self._name = given[0].name
        answer = self.answer([0.0] * len(FIELDS))
        if self._numpy.shape(answer) != (OUTPUTS,):
            return f"answers with shape {answered[0].shape}"
        return "" if self._numpy.isfinite(answer).all() else "answers zeros with a number that is not finite"

    def __call__(self, _gains: Gains, _limits: Limits) -> OnnxPolicy:
        return OnnxPolicy(self)

    def answer(self, values: list[float]) -> Any:
        """Return the first row that the model answers to `values`, in the order of `FIELDS`."""
        given = self._numpy.array([values], self._numpy.float32)
        return self._session.run(None, {self._name: given})[0][0]


@cache
def _bound_memory(runtime: Any) -> None:
    """Give the models of this process one memory of ARENA_BYTES_MAX, once."""
    info = runtime.OrtMemoryInfo("Cpu", runtime.OrtAllocatorType.ORT_ARENA_ALLOCATOR, 0, runtime.OrtMemType.DEFAULT)
    runtime.create_and_register_allocator(info, runtime.OrtArenaCfg({"max_mem": ARENA_BYTES_MAX}))


class OnnxPolicy:
    """Controller of one follower by a model; it remembers nothing from step to step."""

    def __init__(self, model: OnnxModel) -> None:
        self._model = model

    def reset(self, own_pose: Pose2D, own_twist: Twist) -> None:
        """Do nothing: there is no state."""

    def step(self, reference: Reference, own_pose: Pose2D, own_twist: Twist, dt: float) -> Twist:
        v, omega = self._model.answer(seen(reference, own_pose, own_twist))
        return Twist(float(v), float(omega))


def seen(reference: Reference, own_pose: Pose2D, own_twist: Twist) -> list[float]:
    """Return the values of `FIELDS` of a robot at `own_pose` in `map`."""
    c, s = cos(own_pose.theta), sin(own_pose.theta)
    values: list[float] = []
    ahead = reference.predecessor
    for x, y in (
        (reference.x - own_pose.x, reference.y - own_pose.y),
        (reference.vx, reference.vy),
        (ahead.x - own_pose.x, ahead.y - own_pose.y),
    ):
        values += (c * x + s * y, c * y - s * x)
    turn = wrap(reference.heading - own_pose.theta)
    own = (turn, reference.turn_rate, float(reference.direction), own_twist.linear_x, own_twist.angular_z)
    return [*values[:4], *own, *values[4:]]
