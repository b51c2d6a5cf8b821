"""One control step of a follower: from predecessor, commanded slot and own pose to a twist that the drive can execute.

The chosen `Controller` is surrounded by the parts that all controllers share (control.md section 2): the moving slot,
the direction switch, stop, stale data, limits that keep v/omega, acceleration limits. For any input the output is
finite and within the limits.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from math import atan2, cos, hypot, sin

from msgspec import Struct

from lfa.agents.config import CONTROL_PERIOD_S, Gains
from lfa.agents.following.checked_controller import CheckedController
from lfa.agents.following.controller import SLOT_SPEED_MIN_MPS, Controller, Reference
from lfa.agents.following.observer import SlotVelocityObserver
from lfa.agents.following.predecessor import Sighting
from lfa.agents.formation.slot_motion import SlotMotion
from lfa.agents.localization.plausibility import plausible
from lfa.agents.perception.own_readings import OwnReading
from lfa.protocol.geometry import STILL, Pose2D, Twist, wrap
from lfa.protocol.messages.team import Slot
from lfa.protocol.mission import Limits

REVERSE_BELOW_MPS = -0.05
FORWARD_ABOVE_MPS = 0.02
"""Predecessor speeds [m/s] of the direction switch, with hysteresis between the two."""
STOP_ERROR_M = 0.002
STOP_RATE = 1e-3
"""Error [m] and rates [m/s, rad/s] below which the follower stands."""
IDLE_MPS, IDLE_RADPS = 0.003, 0.01
"""Speeds below which the controller has brought the robot as near as its held heading allows."""
SLUGGISH_MPS, SLUGGISH_RADPS, SLUGGISH_S, GAINED_M = 0.02, 0.15, 6.0, 0.01
"""Speeds below which a robot is held off its slot, by its predecessor's body, once it has come no nearer by `GAINED_M`
[m] in so many seconds: it turns to and fro there, and would never rest."""
LEAVE_M = 0.010
"""Increase of the slot's distance [m] at which a standing robot starts again: noise alone does not move it."""
ASTRAY_M = 0.10
"""Distance [m] of an idle robot from its slot above which the controller restarts from the robot's own heading."""
DT_MIN_S, DT_MAX_S = 0.001, 0.1
"""Bounds [s] of a step. A step outside of them (time stood still, ran backwards, jumped) is clamped and counted."""


class State(StrEnum):
    """State of a follower, for `Tracking.state` and `status`."""

    HOLD = "hold"
    """No fresh predecessor state: braked along the path, standing."""
    BLEND = "blend"
    """The slot is still moving to its commanded place."""
    FOLLOW = "follow"
    STAND = "stand"
    """The robot stands in the slot of a standing predecessor."""


class Readout(Struct, frozen=True, gc=False):
    """Slot and errors of the follower's last step, as published in `Tracking`."""

    slot_map: Pose2D
    chi: float
    heading: float
    """Heading psi_r [rad]."""
    error_m: float
    separation_m: float
    """Commanded k and phi, as blended so far."""
    phi: float
    state: State


class Follower:
    """Follower of one robot, for any predecessor."""

    def __init__(
        self,
        gains: Gains,
        limits: Limits,
        controller: Controller,
        *,
        name: str = "",
        heading_filter_m: float = 0.0,
        cruise_mps: float = 0.0,
        radius_m: float = 0.15,
        paper_observer: bool = False,
    ) -> None:
        """Create a follower. `cruise_mps` is the leader's nominal speed, which shifts an old reference ahead (5.2).

        `name` is that of the controller in texts.

        With `paper_observer` the slot's velocity is the estimate of form A of the observer from the slot's positions.
        """
        self._gains = gains
        self._limits = limits
        self._controller = CheckedController(controller, name or type(controller).__name__)
        self._cruise_mps = cruise_mps
        self._overlap_m = 2.0 * radius_m
        self._motion = SlotMotion(gains, limits, heading_filter_m)
        self._paper = PaperVelocity() if paper_observer else None
        self._source: tuple[int, int, bool] | None = None
        self._holding = True
        self._rejoining = False
        self._guarded = False
        self._standing_m = -1.0
        self._sluggish: tuple[float, float] | None = None
        """Time [s] for which a robot has been held off its slot at rest, and its error [m] before; None: it moves."""
        self._direction = 1
        self._heading = 0.0
        self._last = STILL
        self._error_m = 0.0
        self._state = State.HOLD
        self._readout: Readout | None = None
        """Readout of the last step, once it was asked for."""
        self.own_readings: Mapping[str, OwnReading] = {}
        """Newest readings of the robot's own sensors, which the controller gets."""
        self.refused = 0
        """Number of steps whose input was not finite or was implausible."""

    def step(
        self,
        sighting: Sighting | None,
        slot: Slot,
        own_pose: Pose2D,
        own_twist: Twist,
        dt: float = CONTROL_PERIOD_S,
        *,
        on_trace: bool = False,
    ) -> Twist:
        """Return the command for the next `dt`.

        Without a sighting, or with one older than `dead_reckoning_max_s`: brake along the path and hold.
        """
        self._readout = None
        if not DT_MIN_S <= dt <= DT_MAX_S:
            self.refused += 1
            dt = DT_MAX_S if dt > DT_MAX_S else DT_MIN_S
        if not plausible(own_pose, own_twist):
            self.refused += 1
            return self._brake(dt)
        if sighting is None or not self._fresh(sighting):
            return self._brake(dt)
        self._move_slot(sighting, slot, own_pose, on_trace, dt)
        if self._holding:
            self._controller.reset(own_pose, own_twist)
            self._heading, self._holding = own_pose.theta, False
            if self._paper is not None:
                self._paper.reset()
        motion = self._motion
        if self._paper is not None:
            self._paper.observe(motion, sighting, own_pose, self._last, dt)
        reference = self._reference(sighting, own_pose)
        self._error_m = hypot(motion.x - own_pose.x, motion.y - own_pose.y)
        wanted = self._controller.step(reference, own_pose, own_twist, dt)
        if wanted is None:
            return self._brake(dt)
        self._state = State.FOLLOW if motion.settled else State.BLEND
        if self._stands(sighting, wanted, dt):
            self._state, wanted = State.STAND, STILL
            if self._error_m > ASTRAY_M and not self._is_held:
                self._standing_m = -1.0
                self._controller.reset(own_pose, own_twist)
        return self._drive(wanted, dt)

    def rejoin(self, own_pose: Pose2D, own_twist: Twist) -> None:
        """Resume following after an override (an obstacle, a time as leader): the next step starts from here without a
        jump.

        The target starts at the own position and moves to the slot at `offset_rate_max_mps`. A robot that has not
        followed yet has nothing to rejoin: it drives straight to its slot.
        """
        self._holding, self._rejoining = True, self._source is not None
        self._last = own_twist if plausible(own_pose, own_twist) else STILL

    def overridden(self, twist: Twist) -> None:
        """Record that another twist than `step`'s was sent: acceleration limits count from it."""
        self._last = twist

    @property
    def failure(self) -> str | None:
        """What the controller did wrong, with file and line; None while it works. A failed one is not called again."""
        return self._controller.failure

    @property
    def readout(self) -> Readout:
        if self._readout is None:
            m, slot_map = self._motion, Pose2D(self._motion.x, self._motion.y, self._heading)
            parts = m.chi, self._heading, self._error_m, m.separation_m, wrap(m.phi), self._state
            self._readout = Readout(slot_map, *parts)
        return self._readout

    def _fresh(self, sighting: Sighting) -> bool:
        if not plausible(sighting.pose, sighting.twist):
            self.refused += 1
            return False
        return sighting.age_s <= self._gains.dead_reckoning_max_s

    def _move_slot(self, sighting: Sighting, slot: Slot, own_pose: Pose2D, on_trace: bool, dt: float) -> None:
        """Move the slot (steps 2 and 3). When its source has changed, the target continues from where it was."""
        motion = self._motion
        source = (sighting.robot, sighting.epoch, on_trace)
        changed = source != self._source or self._rejoining
        if self._source is None:
            motion.reset(slot, sighting.pose)
        kept = (own_pose.x, own_pose.y) if self._holding else (motion.x, motion.y)
        if changed:
            motion.offset_x = motion.offset_y = 0.0
        motion.lead_m = sighting.delay_s * self._cruise_mps
        if on_trace:
            trace, travelled_m = sighting.trace, sighting.travelled_m
            motion.step_on(trace, travelled_m, slot, sighting.pose, sighting.twist.linear_x, dt)
        else:
            motion.step(slot, sighting.pose, sighting.twist, dt)
        if changed:
            if self._source is not None:
                motion.hang_at(*kept)
            self._guarded = hypot(sighting.pose.x - own_pose.x, sighting.pose.y - own_pose.y) >= self._overlap_m
            self._source, self._rejoining = source, False

    def _reference(self, sighting: Sighting, own_pose: Pose2D) -> Reference:
        motion, v = self._motion, sighting.twist.linear_x
        if v < REVERSE_BELOW_MPS:
            self._direction = -1
        elif v > FORWARD_ABOVE_MPS:
            self._direction = 1
        if motion.vx * motion.vx + motion.vy * motion.vy > SLOT_SPEED_MIN_MPS**2:
            self._heading = atan2(self._direction * motion.vy, self._direction * motion.vx)
        if not self._guarded:
            apart = hypot(sighting.pose.x - own_pose.x, sighting.pose.y - own_pose.y)
            self._guarded = apart >= self._gains.d_min_m
        return Reference(
            motion.x, motion.y, motion.vx, motion.vy, self._heading, motion.chi_rate, self._direction,
            sighting.pose, sighting.twist, motion.separation_m, wrap(motion.phi), self._guarded, self.own_readings,
        )  # fmt: skip

    def _stands(self, sighting: Sighting, wanted: Twist, dt: float) -> bool:
        """Return whether to stand: stop dead-band with hysteresis, for a resting target and no gain from moving on."""
        if not self._target_rests(sighting):
            self._standing_m, self._sluggish = -1.0, None
        elif self._standing_m < 0.0:
            self._note_sluggish(wanted, dt)
            idle = abs(wanted.linear_x) < IDLE_MPS and abs(wanted.angular_z) < IDLE_RADPS
            if idle or self._error_m < STOP_ERROR_M or self._is_held:
                self._standing_m = self._error_m
        elif self._error_m > self._standing_m + LEAVE_M:
            self._standing_m, self._sluggish = -1.0, None
        return self._standing_m >= 0.0

    @property
    def _is_held(self) -> bool:
        return self._sluggish is not None and self._sluggish[0] >= SLUGGISH_S

    def _note_sluggish(self, wanted: Twist, dt: float) -> None:
        """Update the time for which the controller wants next to nothing and wins nothing."""
        slow = abs(wanted.linear_x) < SLUGGISH_MPS and abs(wanted.angular_z) < SLUGGISH_RADPS
        if not slow:
            self._sluggish = None
        elif self._sluggish is None or self._error_m < self._sluggish[1] - GAINED_M:
            self._sluggish = 0.0, self._error_m
        else:
            self._sluggish = self._sluggish[0] + dt, self._sluggish[1]

    def _target_rests(self, sighting: Sighting) -> bool:
        twist = sighting.twist
        return abs(twist.linear_x) < STOP_RATE and abs(twist.angular_z) < STOP_RATE and self._motion.settled

    def _drive(self, wanted: Twist, dt: float) -> Twist:
        """Apply the drive's limits with v/omega kept, then its acceleration limits (steps 8 and 9)."""
        limits, last = self._limits, self._last
        v, omega = wanted.linear_x, wanted.angular_z
        v_max = limits.v_max_mps if v >= 0.0 else limits.v_reverse_max_mps
        scale = max(abs(v) / (v_max + 1e-9), abs(omega) / limits.omega_max_radps)
        if scale > 1.0:
            v, omega = v / scale, omega / scale
        dv, domega = limits.a_max_mps2 * dt, limits.alpha_max_radps2 * dt
        v0, omega0 = last.linear_x, last.angular_z
        v = v0 + dv if v > v0 + dv else v0 - dv if v < v0 - dv else v
        omega = omega0 + domega if omega > omega0 + domega else omega0 - domega if omega < omega0 - domega else omega
        self._last = Twist(v, omega)
        return self._last

    def _brake(self, dt: float) -> Twist:
        """Stop along the path that is being driven."""
        self._state, self._holding = State.HOLD, True
        limits, v, omega = self._limits, self._last.linear_x, self._last.angular_z
        periods = max(abs(v) / (limits.a_max_mps2 * dt), abs(omega) / (limits.alpha_max_radps2 * dt))
        rest = 1.0 - 1.0 / periods if periods > 1.0 else 0.0
        self._last = Twist(v * rest, omega * rest)
        return self._last


class PaperVelocity:
    """Form A of the observer in the loop: replaces the slot's velocity, and does not use the predecessor's turn
    rate.
    """

    def __init__(self) -> None:
        self._observer = SlotVelocityObserver()
        self._age_s = 0.0

    def reset(self) -> None:
        self._observer.reset()

    def observe(self, motion: SlotMotion, sighting: Sighting, own_pose: Pose2D, own_twist: Twist, dt: float) -> None:
        """Update the slot's velocity; `own_twist` is the twist driven for the last `dt`."""
        c, s = cos(own_pose.theta), sin(own_pose.theta)
        dx, dy = motion.x - own_pose.x, motion.y - own_pose.y
        measured = (c * dx + s * dy, c * dy - s * dx) if sighting.age_s < self._age_s + 0.5 * dt else None
        self._age_s = sighting.age_s
        wx, wy = self._observer.step(measured, own_twist, dt)
        motion.vx, motion.vy = c * wx - s * wy, s * wx + c * wy
        motion.chi_rate = 0.0
