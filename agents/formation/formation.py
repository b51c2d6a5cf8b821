"""Commanded slots of the followers, and the speeds at which a leader can turn with them.

phi is the bearing of the follower's slot in its predecessor's formation frame, counter-clockwise, pi straight behind
(control.md sections 0 and 4). How a slot moves when its command changes is in `slot_motion.py`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import cos, hypot, pi, sin, sqrt

from lfa.protocol.errors import Refused
from lfa.protocol.geometry import TAU, wrap
from lfa.protocol.messages.consensus import NO_TERM, Term
from lfa.protocol.messages.team import FormationNote, Slot
from lfa.protocol.mission import FormationSpec, Limits, Mission, Side

SIDES: dict[str, Side] = {"left": "left", "right": "right", "column": "column", "zigzag": "zigzag"}
SEPARATION_MAX_M = 100.0
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
    if not separation_min_m <= slot.separation_m <= SEPARATION_MAX_M:  # true of no NaN either
        right = f"must be from {separation_min_m:g} (robots' size and margin) to {SEPARATION_MAX_M:g}"
        raise Refused(f"{where}: separation_m = {slot.separation_m}: {right}")
    if not -TAU <= slot.phi <= TAU:
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
        """Create as a mission wants it; no slot is nearer than two robots beside each other and 0.1 m."""
        return cls(mission.formation, mission.robots, 2.0 * mission.radius_m + 0.1, trace=mission.following.trace)

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

    Followers on a trace have f = 1: pass no slots then. A leader without slots needs no margin of speed, for nobody has
    to catch up with a slot of its own.
    """
    cap = margin * limits.v_max_mps if slots else limits.v_max_mps
    if curvature == 0.0:
        return cap  # all factors are 1
    if slots:
        cap /= max([1.0, *speed_factors(slots, curvature)])
    return min(cap, margin * limits.omega_max_radps / abs(curvature))


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
