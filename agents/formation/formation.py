"""Slots of the followers: commanded place, orientation, change, and motion.

phi is the bearing of the follower's slot in its predecessor's formation frame, counter-clockwise, pi straight behind
(control.md sections 0 and 4). A change of (k, phi) is blended in polar form through the rear; a change of the slot's
reference (another predecessor, a trace, a rejoin) by a shrinking offset: the target never jumps.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import cos, hypot, isfinite, pi, sin, sqrt

from lfa.agents.config import Gains
from lfa.agents.formation.kinematics import slot_velocity
from lfa.agents.formation.pose_history import PoseHistory
from lfa.protocol.errors import Refused
from lfa.protocol.geometry import TAU, Pose2D, Twist, bearing, wrap
from lfa.protocol.messages.consensus import NO_TERM, Term
from lfa.protocol.messages.team import FormationNote, Slot
from lfa.protocol.mission import FormationSpec, Limits, Mission, Side

SIDES: dict[str, Side] = {"left": "left", "right": "right", "column": "column", "zigzag": "zigzag"}
SEPARATION_MAX_M = 100.0
BLEND_SHARE_MIN = 0.1
"""Minimum rate of a blend, as a share of its rate limit, however fast the predecessor drives."""
OFFSET_PER_S, OFFSET_LAST_MPS = 2.0, 0.01
"""Rate of the offset's last part, as a share of the offset [1/s] plus a minimum [m/s]. It is slow, because a robot that
enters its slot at an angle swings past a slot that comes to rest at once."""
SPEED_MARGIN = 0.9
PLANNED_MARGIN = 0.8
SLOT_SPEED_MIN_MPS = 0.05
"""Speed [m/s] below which a slot has no direction: the heading is not controlled (control.md 2.2)."""
COLUMN_BELOW_MPS = 0.15
"""Leader speed [m/s] in a bend below which the leader orders column first."""


# --- commanded slots -----------------------------------------------------------------------------------------


def phi_of(side: Side, angle_rad: float, index: int) -> float:
    """Return phi^d of the `index`-th follower (from 0): the corrected (32) and (33), in (-pi, pi].

    `angle_rad` is alpha in [0, pi/2], off the predecessor's rear axis. Zigzag alternates left and right.
    """
    if side == "column":
        return pi
    left = side == "left" or (side == "zigzag" and index % 2 == 0)
    return wrap(pi - angle_rad if left else pi + angle_rad)


def paper_phi(side: Side, phi: float) -> float:
    """Return phi^d for the paper's input phi in [0, pi], with (32) and (33) corrected. Raise `Refused` at pi/2, where
    they jump.
    """
    if not 0.0 <= phi <= pi or phi == pi / 2:
        raise Refused(f"phi = {phi:g}: must be in [0, pi] and not pi/2, where (32) and (33) jump by pi/2")
    if phi < pi / 2:
        return phi_of(side, phi, 0)
    opposite: Side = "right" if side == "left" else "left"
    return phi_of(opposite if side in ("left", "right") else side, phi - pi / 2, 0)


def slots_of(spec: FormationSpec, followers: Sequence[int]) -> tuple[Slot, ...]:
    """Return the commanded slot of each follower, in the order of the chain."""
    return tuple(
        Slot(robot, spec.separation_m, phi_of(spec.side, spec.angle_rad, index))
        for index, robot in enumerate(followers)
    )


def named(name: str, spec: FormationSpec) -> FormationSpec:
    """Return `spec` with the side that an operator names (`lfa formation column`). Raise `Refused`."""
    if name not in SIDES:
        raise Refused(f"formation = {name}: must be one of {', '.join(SIDES)}")
    return FormationSpec(spec.separation_m, spec.angle_rad, SIDES[name], spec.heading_filter_m)


def check_slot(slot: Slot, separation_min_m: float) -> Slot:
    """Return `slot`; raise `Refused` when no follower can take it."""
    where = f"slot of robot{slot.robot}"
    if not (isfinite(slot.separation_m) and separation_min_m <= slot.separation_m <= SEPARATION_MAX_M):
        right = f"must be from {separation_min_m:g} (robots' size and margin) to {SEPARATION_MAX_M:g}"
        raise Refused(f"{where}: separation_m = {slot.separation_m}: {right}")
    if not (isfinite(slot.phi) and -TAU <= slot.phi <= TAU):
        raise Refused(f"{where}: phi = {slot.phi}: must be within -2 pi and 2 pi")
    if abs(wrap(slot.phi)) < pi / 2 - 1e-9:
        raise Refused(f"{where}: phi = {slot.phi:g}: must be beside or behind, |phi| >= pi/2")
    return slot


class Formation:
    """Orientation requests of one team: the highest (term, number) counts, whether messages are late, repeated or
    lost.
    """

    def __init__(
        self, spec: FormationSpec, robots: Sequence[int], separation_min_m: float, *, trace: bool = False
    ) -> None:
        """Create with `robots` in the order of the first chain; `spec` and `trace` hold until a leader requests
        otherwise.
        """
        self._separation_min_m = separation_min_m
        self._spec = spec
        self._slots = {slot.robot: slot for slot in slots_of(spec, robots[1:])}
        self.trace = trace
        """True when followers drive on the path of their predecessor, k^d of it behind."""
        self.side = ""
        """Side of the newest order that was heard; empty: none."""
        self.version: tuple[Term, int] = (NO_TERM, -1)
        self.refused = 0

    @classmethod
    def of(cls, mission: Mission) -> Formation:
        formation = cls(mission.formation, mission.robots, 2.0 * mission.radius_m + 0.1, trace=mission.following.trace)
        formation.trace = mission.following.trace
        return formation

    def request(self, note: FormationNote) -> bool:
        """Apply a leader's request; return False if it is old, repeated, or cannot be obeyed (counted)."""
        if (note.term, note.number) <= self.version:
            return False
        try:
            slots = {slot.robot: check_slot(slot, self._separation_min_m) for slot in note.slots}
        except Refused:
            self.refused += 1
            return False
        self.version = (note.term, note.number)
        self._slots.update(slots)
        self.trace, self.side = note.trace, note.side if note.side in SIDES else ""
        return True

    def is_named(self, robot: int) -> bool:
        """Return whether the mission or a request has named a slot for `robot`."""
        return robot in self._slots

    def slot_of(self, robot: int) -> Slot:
        """Return the commanded slot of `robot`; straight behind if no request has named it."""
        return self._slots.get(robot) or Slot(robot, self._spec.separation_m, pi)


# --- curvature (control.md 2.2) ------------------------------------------------------------------------------


def speed_factors(slots: Iterable[Slot], curvature: float) -> list[float]:
    """Return f of each robot of the chain: steady speed over the leader's in a bend of `curvature` [1/m], left > 0.

    All robots turn at the leader's rate, so R' = f R, and each hop's own factor is that of its predecessor's bend.
    """
    factors: list[float] = []
    total = 1.0
    for slot in slots:
        k = slot.separation_m
        hop = hypot(1.0 - k * curvature * sin(slot.phi), k * curvature * cos(slot.phi))
        total *= hop
        curvature /= max(hop, 1e-6)
        factors.append(total)
    return factors


def leader_speed_cap(slots: Sequence[Slot], curvature: float, limits: Limits, margin: float = SPEED_MARGIN) -> float:
    """Return the maximum leader speed [m/s] in a bend at which f v stays within `margin` of the limits for all robots.

    Followers on a trace have f = 1: pass no slots then.
    """
    fastest = max([1.0, *speed_factors(slots, curvature)])
    cap = margin * limits.v_max_mps / fastest
    if curvature != 0.0:
        cap = min(cap, margin * limits.omega_max_radps / abs(curvature))
    return cap


def leader_speed_floor(slots: Sequence[Slot], curvature: float) -> float:
    """Return the minimum leader speed [m/s] at which every slot has a direction of motion; inf when one stands
    still.
    """
    slowest = min([1.0, *speed_factors(slots, curvature)])
    return SLOT_SPEED_MIN_MPS / slowest if slowest > 1e-6 else float("inf")


def radius_min(slots: Sequence[Slot], factor_max: float) -> float:
    """Return the minimum leader radius [m], for both turn directions, at which no robot needs more than `factor_max`
    v.
    """
    low, high = 0.01, 1e4
    for _ in range(60):
        middle = sqrt(low * high)
        worst = max(f for turn in (1.0, -1.0) for f in speed_factors(slots, turn / middle))
        low, high = (middle, high) if worst > factor_max else (low, middle)
    return high


# --- the moving slot (law, steps 2 and 3) --------------------------------------------------------------------


class SlotMotion:
    """Moving slot (steps 2 and 3 of the law): chi, the blended (k, phi) and the offset o yield r and its velocity.

    After `step` the attributes x, y [m], vx, vy [m/s] (in `map`), chi, chi_rate, separation_m and phi are valid.
    """

    __slots__ = (
        "_gains", "_limit_mps", "chi", "chi_rate", "heading_filter_m", "lead_m", "offset_x", "offset_y", "phi",
        "separation_m", "settled", "vx", "vy", "x", "y",
    )  # fmt: skip

    def __init__(self, gains: Gains, limits: Limits, heading_filter_m: float) -> None:
        self._gains = gains
        self._limit_mps = gains.slot_speed_share * limits.v_max_mps
        self.heading_filter_m = heading_filter_m
        self.lead_m = 0.0
        """Forward shift [m] of the slot along chi that compensates a reference known to be old (5.2)."""
        self.separation_m = 0.0
        self.phi = pi
        self.chi = 0.0
        self.chi_rate = 0.0
        self.offset_x = self.offset_y = 0.0
        self.x = self.y = self.vx = self.vy = 0.0
        self.settled = True

    def reset(self, slot: Slot, predecessor: Pose2D) -> None:
        """Start in the commanded slot, without blends."""
        self.separation_m, self.phi = slot.separation_m, slot.phi % TAU
        self.chi, self.chi_rate = predecessor.theta, 0.0
        self.offset_x = self.offset_y = 0.0

    def hang_at(self, x: float, y: float) -> None:
        """Keep the target at (x, y), right after a step, and let the offset shrink from there."""
        self.offset_x += x - self.x
        self.offset_y += y - self.y
        self.x, self.y = x, y

    def step(self, slot: Slot, predecessor: Pose2D, twist: Twist, dt: float) -> None:
        """Advance by `dt` towards the commanded `slot`; `predecessor` is its pose at the end of that time."""
        theta, v = predecessor.theta, twist.linear_x
        if self.heading_filter_m > 0.0:
            self.chi = wrap(self.chi + self.chi_rate * dt)
            limit = self._gains.chi_rate_max_radps
            rate = abs(v) / self.heading_filter_m * wrap(theta - self.chi)
            self.chi_rate = limit if rate > limit else -limit if rate < -limit else rate
        else:
            self.chi, self.chi_rate = theta, twist.angular_z
        angle = self.chi + self.phi
        c, s = cos(angle), sin(angle)
        k = self.separation_m
        behind_x, behind_y = k * c, k * s
        if self.lead_m != 0.0:
            behind_x += self.lead_m * cos(self.chi)
            behind_y += self.lead_m * sin(self.chi)
        self.vx, self.vy = slot_velocity(theta, v, self.chi_rate, behind_x, behind_y)
        self.x = predecessor.x + behind_x + self.offset_x
        self.y = predecessor.y + behind_y + self.offset_y
        self.settled = self._blend(slot, c, s, dt)

    def step_on(
        self, trace: PoseHistory, travelled_m: float, slot: Slot, predecessor: Pose2D, v: float, dt: float
    ) -> None:
        """Advance by `dt` on the predecessor's trace, `slot.separation_m` of path behind it (5.5)."""
        point = trace.at(travelled_m - self.separation_m + self.lead_m)
        c, s = cos(point.theta), sin(point.theta)
        self.vx, self.vy = v * c, v * s
        self.x, self.y = point.x + self.offset_x, point.y + self.offset_y
        self.chi, self.phi = bearing(Pose2D(point.x, point.y), predecessor), pi
        self.chi_rate = point.curvature * v
        self.settled = self._blend(Slot(slot.robot, slot.separation_m, pi), -c, -s, dt)

    def _blend(self, slot: Slot, c: float, s: float, dt: float) -> bool:
        """Move (k, phi) and the offset towards their targets; return True when they are reached."""
        dk = slot.separation_m - self.separation_m
        dphi = slot.phi % TAU - self.phi
        ox, oy = self.offset_x, self.offset_y
        if dk == 0.0 and dphi == 0.0 and ox == 0.0 and oy == 0.0:
            return True
        gains = self._gains
        k_rate = _towards(dk, gains.separation_rate_max_mps, dt)
        phi_rate = _towards(dphi, gains.phi_rate_max_radps, dt)
        o = hypot(ox, oy)
        o_rate = _towards(-o, min(gains.offset_rate_max_mps, OFFSET_PER_S * o + OFFSET_LAST_MPS), dt)
        o_vx, o_vy = (o_rate * ox / o, o_rate * oy / o) if o > 0.0 else (0.0, 0.0)
        bx = k_rate * c - self.separation_m * phi_rate * s + o_vx
        by = k_rate * s + self.separation_m * phi_rate * c + o_vy
        share = max(BLEND_SHARE_MIN, _share(self.vx, self.vy, bx, by, self._limit_mps))
        self.vx += share * bx
        self.vy += share * by
        step = share * dt
        self.separation_m = _approach(self.separation_m, k_rate * step, slot.separation_m)
        self.phi = _approach(self.phi, phi_rate * step, slot.phi % TAU)
        self.offset_x = _approach(ox, o_vx * step, 0.0)
        self.offset_y = _approach(oy, o_vy * step, 0.0)
        return False


def _towards(rest: float, rate_max: float, dt: float) -> float:
    """Return the rate that removes `rest`, at most `rate_max`, without overshoot within `dt`."""
    rate = rest / dt
    return rate_max if rate > rate_max else -rate_max if rate < -rate_max else rate


def _approach(value: float, step: float, target: float) -> float:
    """Return `value` + `step`, or exactly `target` when they agree within numerical precision."""
    moved = value + step
    return target if abs(target - moved) < 1e-9 else moved


def _share(ax: float, ay: float, bx: float, by: float, limit: float) -> float:
    """Return the largest s in [0, 1] with |a + s b| <= limit; 0 when |a| alone exceeds it."""
    if hypot(ax + bx, ay + by) <= limit:
        return 1.0
    rest = limit * limit - ax * ax - ay * ay
    if rest <= 0.0:
        return 0.0
    bb, ab = bx * bx + by * by, ax * bx + ay * by
    return min(1.0, (-ab + sqrt(ab * ab + bb * rest)) / bb)
