"""Controller whose faults are results: an exception, or an answer that is no finite twist, becomes a line of text."""

from __future__ import annotations

from math import isfinite
from typing import TypeGuard

from lfa.agents.following.controller import Controller, Reference
from lfa.protocol.geometry import Pose2D, Twist
from lfa.protocol.plug_in import FAULTS, error_text, place_of


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
        except FAULTS as error:
            self.failure = f"controller {self._name}: {error_text(error, self._controller.reset)}"

    def step(self, reference: Reference, own_pose: Pose2D, own_twist: Twist, dt: float) -> Twist | None:
        """Return the controller's twist; None once it has failed."""
        if self.failure is not None:
            return None
        try:
            wanted = self._controller.step(reference, own_pose, own_twist, dt)
        except FAULTS as error:
            self.failure = f"controller {self._name}: {error_text(error, self._controller.step)}"
            return None
        if is_finite_twist(wanted):
            return wanted
        says = f"{place_of(self._controller.step)}step returned {_shown(wanted)}"
        self.failure = f"controller {self._name}: {says}, must be a Twist of finite numbers"
        return None


def is_finite_twist(answer: object) -> TypeGuard[Twist]:
    """Return True for a Twist of finite numbers: what a user's own code has to answer."""
    try:
        return isinstance(answer, Twist) and isfinite(answer.linear_x) and isfinite(answer.angular_z)
    except (TypeError, OverflowError):  # a text, or a whole number beyond all floats
        return False


def _shown(wanted: object) -> str:
    if isinstance(wanted, Twist):
        return f"Twist({wanted.linear_x}, {wanted.angular_z})"
    return "nothing" if wanted is None else f"a value of type {type(wanted).__name__}"
