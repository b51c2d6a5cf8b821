"""Controller whose faults are results: an exception, or an answer that is no finite twist, becomes a line of text."""

from __future__ import annotations

from math import isfinite
from pathlib import Path

from lfa.agents.following.controller import Controller, Reference
from lfa.protocol.geometry import Pose2D, Twist
from lfa.protocol.plug_in import error_text


class CheckedController:
    """Controller of a follower, called `name` in texts. After its first fault it is not called again."""

    def __init__(self, controller: Controller, name: str) -> None:
        self._controller = controller
        self._name = name
        self.failure: str | None = None
        """What the controller did wrong, with file and line; None while it works."""

    def reset(self, own_pose: Pose2D, own_twist: Twist) -> None:
        """Restart the controller from the present state."""
        if self.failure is not None:
            return
        try:
            self._controller.reset(own_pose, own_twist)
        except Exception as error:  # noqa: BLE001 - a plug-in may fail in any way, and its robot must come to rest
            self.failure = f"controller {self._name}: {error_text(error)}"

    def step(self, reference: Reference, own_pose: Pose2D, own_twist: Twist, dt: float) -> Twist | None:
        """Return the controller's twist; None once it has failed."""
        if self.failure is not None:
            return None
        try:
            wanted = self._controller.step(reference, own_pose, own_twist, dt)
            if isfinite(wanted.linear_x) and isfinite(wanted.angular_z):
                return wanted
        except Exception as error:  # noqa: BLE001 - as above
            # An answer of another type fails in this file: it has no linear_x, or one that is no number.
            last = error.__traceback__
            while last is not None and last.tb_next is not None:
                last = last.tb_next
            if last is None or last.tb_frame.f_code.co_filename != __file__:
                self.failure = f"controller {self._name}: {error_text(error)}"
                return None
        self.failure = f"controller {self._name}: {_place(self._controller)}step returned {_shown(wanted)}, must be " \
                       "a Twist of finite numbers"  # fmt: skip
        return None


def _shown(wanted: object) -> str:
    if isinstance(wanted, Twist):
        return f"Twist({wanted.linear_x}, {wanted.angular_z})"
    return "nothing" if wanted is None else f"a value of type {type(wanted).__name__}"


def _place(controller: Controller) -> str:
    """Return file and line of the controller's `step`, as a prefix; empty where Python does not know it."""
    code = getattr(type(controller).step, "__code__", None)
    return "" if code is None else f"{Path(code.co_filename).name}:{code.co_firstlineno}: "
