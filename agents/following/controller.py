"""Controller interface for followers, and the law of control.md section 2 (steps 4 to 7) as the default controller.

`follower.py` holds what all controllers share: the moving slot (steps 2, 3), the drive's limits (8, 9), stale data, the
stop. A controller is found by name among the entry points `lfa.controllers`, or those added by `add_controller`.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import cos, hypot, sin
from typing import Protocol

from msgspec import Struct

from lfa.agents.config import Gains
from lfa.agents.perception.own_readings import OwnReading
from lfa.protocol.errors import Refused
from lfa.protocol.geometry import Pose2D, Twist, wrap
from lfa.protocol.mission import Limits
from lfa.protocol.plug_in import PlugIns

ENTRY_POINTS = "lfa.controllers"
CONTROLLERS = PlugIns("controller", ENTRY_POINTS, "--controller ")
DEFAULT_CONTROLLER = "law"
SLOT_SPEED_MIN_MPS = 0.05
"""Slot speed [m/s] below which the slot has no direction: the desired heading is held."""
FLIP_RAD = 2.0
"""Maximum angle [rad] by which a reversing predecessor turns the desired heading."""


class Reference(Struct, frozen=True, gc=False):
    """Present target of the follower, in `map`: [m], [rad], [m/s], [rad/s]."""

    x: float
    """Position r of the slot."""
    y: float
    vx: float
    """Velocity of the slot."""
    vy: float
    heading: float
    """Heading psi_r of a robot that drives with the slot (backwards when `direction` is -1)."""
    turn_rate: float
    """Turn rate of the formation heading: feed-forward for the follower's own turning."""
    direction: int
    """Direction sigma: 1 forwards, -1 while the predecessor reverses."""
    predecessor: Pose2D
    predecessor_twist: Twist
    separation_m: float
    """Commanded k and phi, as blended so far."""
    phi: float
    guarded: bool
    """False while the bodies overlap, which is possible in simulation only."""
    readings: Mapping[str, OwnReading] = {}
    """Newest reading of each sensor of a user's own on this robot, by its name."""

    @property
    def speed(self) -> float:
        """Speed of the slot, positive [m/s]."""
        return hypot(self.vx, self.vy)


class Controller(Protocol):
    """Controller from slot to twist. `step` is called at `config.CONTROL_HZ`; the caller enforces the drive's
    limits.
    """

    def reset(self, own_pose: Pose2D, own_twist: Twist) -> None:
        """Restart from the present state: at the start, after an override, when data were stale."""

    def step(self, reference: Reference, own_pose: Pose2D, own_twist: Twist, dt: float) -> Twist:
        """Return the wanted twist; it may exceed the limits."""


class MakeController(Protocol):
    """Class or function that an entry point names. With a `Parameters` of its own, called with a third argument."""

    def __call__(self, gains: Gains, limits: Limits, /) -> Controller: ...


def add_controller(name: str, make: MakeController) -> None:
    """Make `make` the controller called `name` in this process: for a script or a notebook that simulates.

    Robots that are processes find controllers by entry point or by their option `--controller`. Raise `Refused` for
    the default's name.
    """
    if name == DEFAULT_CONTROLLER:
        raise Refused(f"controller {name}: the default one cannot be replaced, give another name")
    CONTROLLERS.add(name, make)


def find_controller(name: str) -> MakeController:
    """Return the installed or added controller called `name`. Raise `Refused`. Entry points are read at the start."""
    if name == DEFAULT_CONTROLLER:
        return Law
    if name not in CONTROLLERS.names():
        choices = ", ".join(CONTROLLERS.names())
        raise Refused(f"controller = {name}: must be one of {choices} (entry points {ENTRY_POINTS}), or be given by "
                      "--controller FILE.py:Class")  # fmt: skip
    make: MakeController = CONTROLLERS.find(name)
    return make


class Law:
    """Look-ahead point with a filtered desired heading and norm-saturated feedback: |e(t)| = |e(0)| exp(-K t)."""

    def __init__(self, gains: Gains, limits: Limits) -> None:
        self._gains = gains
        self._omega_max = limits.omega_max_radps
        self.heading = 0.0
        """Desired heading psi_d: a filter's state, so that its rate is known without any robot's acceleration."""
        self._direction = 1

    def reset(self, own_pose: Pose2D, own_twist: Twist) -> None:
        self.heading = own_pose.theta
        self._direction = 1

    def step(self, reference: Reference, own_pose: Pose2D, own_twist: Twist, dt: float) -> Twist:
        gains = self._gains
        sigma = reference.direction
        theta = own_pose.theta
        if sigma != self._direction:
            self._direction, self.heading = sigma, theta
        psi = self.heading
        psi_rate = self._turn(reference, psi)
        self.heading = wrap(psi + psi_rate * dt)

        # Steps 5 and 6: the look-ahead point's target, its velocity, and feedback of at most m.
        reach = sigma * gains.b_m
        cp, sp, cf, sf = cos(psi), sin(psi), cos(theta), sin(theta)
        ex = reference.x - own_pose.x + reach * (cp - cf)
        ey = reference.y - own_pose.y + reach * (sp - sf)
        error = hypot(ex, ey)
        k = gains.k_per_s
        if k * error > gains.m_mps:
            k = gains.m_mps / error
        a = gains.feed_forward
        ux = a * (reference.vx - reach * psi_rate * sp) + k * ex
        uy = a * (reference.vy + reach * psi_rate * cp) + k * ey
        if reference.guarded:
            ux, uy = guard(ux, uy, reference, own_pose, gains)
        return Twist(cf * ux + sf * uy, sigma * (cf * uy - sf * ux) / gains.b_m)

    def _turn(self, reference: Reference, psi: float) -> float:
        """Return the rate of the desired heading [rad/s] (step 4)."""
        if reference.vx * reference.vx + reference.vy * reference.vy <= SLOT_SPEED_MIN_MPS**2:
            return 0.0
        ahead = wrap(reference.heading - psi)
        if reference.direction < 0 and abs(ahead) > FLIP_RAD:
            return 0.0
        rate = reference.turn_rate + self._gains.lambda_psi_per_s * ahead
        limit = self._omega_max
        return limit if rate > limit else -limit if rate < -limit else rate


def guard(ux: float, uy: float, reference: Reference, own_pose: Pose2D, gains: Gains) -> tuple[float, float]:
    """Limit the velocity [m/s] towards the predecessor to the predecessor's own plus 2 (D - d_min) (step 7)."""
    nx, ny = reference.predecessor.x - own_pose.x, reference.predecessor.y - own_pose.y
    apart = hypot(nx, ny)
    if apart < 1e-9:
        return ux, uy
    nx, ny = nx / apart, ny / apart
    theta, v = reference.predecessor.theta, reference.predecessor_twist.linear_x
    closing_max = v * (nx * cos(theta) + ny * sin(theta)) + gains.guard_per_s * (apart - gains.d_min_m)
    excess = ux * nx + uy * ny - closing_max
    return (ux - excess * nx, uy - excess * ny) if excess > 0.0 else (ux, uy)
