"""Behaviours of one's own: each may want another twist than the built-in behaviour of the robot's role.

They act in the order in which the mission names them, after the built-in behaviour and before the robot gives way to
what moves and before all limits: what they want is braked for like any other motion. A behaviour is found by name among
the entry points `lfa.behaviors`, from a file by `--behavior FILE.py:Class`, or as `add_behavior` has added it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from msgspec import Struct

from lfa.agents.following.checked_controller import is_finite_twist
from lfa.agents.perception.obstacle_tracker import Feature
from lfa.agents.perception.scan import Point
from lfa.protocol.config_file.mistake import Mistake, RefusedValue
from lfa.protocol.geometry import STILL, Pose2D, Twist
from lfa.protocol.messages.consensus import Role
from lfa.protocol.mission import Mission
from lfa.protocol.plug_in import FAULTS, PlugIns, error_text, place_of

BEHAVIORS = PlugIns("behavior", "lfa.behaviors", "--behavior ")


class BehaviorInput(Struct, frozen=True):
    """What a behaviour decides by in one control step."""

    now: float
    """Time [s]."""
    role: Role
    pose: Pose2D
    """Own pose in `map` [m, rad]."""
    last: Twist
    """Last command [m/s, rad/s]."""
    wanted: Twist
    """Twist [m/s, rad/s] of the built-in behaviour, or of the behaviour before."""
    still: Sequence[Point]
    """Points [m] of what stands, in `base_link`."""
    moving: Sequence[Feature]
    """What moves, in `map`, with its velocity."""


class Behavior(Protocol):
    """Behaviour of one robot, for as long as it has its mission."""

    def step(self, seen: BehaviorInput) -> Twist | None:
        """Return another twist than `seen.wanted`; None: that one is right."""


class MakeBehavior(Protocol):
    """Class or function that an entry point names."""

    def __call__(self, mission: Mission, /) -> Behavior: ...


def add_behavior(name: str, make: MakeBehavior) -> None:
    """Make `make` the behaviour called `name` in this process: for a script or a notebook that simulates."""
    BEHAVIORS.add(name, make)


class OwnBehaviors:
    """The behaviours that a mission names, for one robot. After a fault of one the robot comes to rest."""

    def __init__(self, mission: Mission) -> None:
        """Make the behaviours. Raise `RefusedValue` for an unknown name, and for a class that raises."""
        self._behaviors = [(name, _made(name, mission)) for name in mission.behaviors]
        self.failure: str | None = None
        """What a behaviour did wrong, with file and line; None while all work."""

    def step(self, seen: BehaviorInput) -> Twist:
        """Return the twist that is wanted after all behaviours; still once one has failed."""
        wanted = seen.wanted
        for name, behavior in self._behaviors:
            if self.failure is not None:
                return STILL
            try:
                answer = behavior.step(
                    BehaviorInput(seen.now, seen.role, seen.pose, seen.last, wanted, seen.still, seen.moving)
                )
            except FAULTS as error:
                self.failure = f"behavior {name}: {error_text(error, behavior.step)}"
                return STILL
            if answer is None:
                continue
            if not is_finite_twist(answer):
                says = f"{place_of(behavior.step)}step returned {answer!r}"
                self.failure = f"behavior {name}: {says}, must be a Twist of finite numbers or None"
                return STILL
            wanted = answer
        return wanted


def _made(name: str, mission: Mission) -> Behavior:
    made: Behavior = BEHAVIORS.make(name, {}, "mission.behaviors", mission)
    if not callable(getattr(made, "step", None)):
        raise RefusedValue(Mistake("mission.behaviors", f": behavior {name} must be a class with the method step"))
    return made
