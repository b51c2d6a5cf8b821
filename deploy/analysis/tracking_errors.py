"""How well each follower kept its place, from ground truth at equal times and from what it was commanded to keep.

`distance` = D - k^d, `bearing` against the slot as it is blended (chi + phi), `bearing_asked` against the one that the
leader asked for last (chi + phi^d), `bearing_body` against theta_P + phi (the paper's), `heading` = wrap(psi_r -
theta_F) (control.md, equation table). What was commanded comes from the follower's `tracking` messages and the leader's
requests; where it truly stood comes from the world.
"""

from __future__ import annotations

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

from lfa.deploy.recording.mcap_reader import Array, RecordedRun

Mask = NDArray[np.bool_]

TRACKING_AGE_MAX_S = 0.2  # five periods: an older command says nothing about now
SETTLED_M = 0.05
RECOVERY_S_MAX = 8.0  # a change of place must be made good within this (control.md section 6)
_CHANGED_PHI = 1e-6
_CHANGED_M = 1e-6


class TrackingErrors(Struct):
    """Of one follower, one entry a ground truth during which it followed somebody; [s], [m], [rad]."""

    t: Array
    predecessor: Array
    distance: Array
    bearing: Array
    bearing_asked: Array
    bearing_body: Array
    heading: Array
    avoiding: Mask
    changing: Mask
    """Its place in the formation was changing: another predecessor, separation or angle."""
    excused: Mask
    """Avoiding or changing, and not yet back within `SETTLED_M`, for `RECOVERY_S_MAX` at most."""

    @property
    def settled_after_s(self) -> float | None:
        """When the distance error came within `SETTLED_M` for good, excused times left out; None: never."""
        bad = np.flatnonzero((np.abs(self.distance) >= SETTLED_M) & ~self.excused)
        if bad.size == 0:
            return float(self.t[0]) if self.t.size else None
        return float(self.t[bad[-1] + 1]) if bad[-1] + 1 < self.t.size else None

    @property
    def steady(self) -> Mask:
        """Where rms values are taken: settled, and not excused."""
        settled = self.settled_after_s
        return (self.t >= settled) & ~self.excused if settled is not None else np.zeros(self.t.size, dtype=bool)


def of_follower(trace: RecordedRun, robot: int) -> TrackingErrors | None:
    """The errors of `robot`, None when it never followed anybody."""
    own, said = trace.truth.get(robot), trace.tracking.get(robot)
    if own is None or said is None:
        return None
    said = said[np.isin(said[:, 1], list(trace.truth)) & (said[:, 2] > 0.0)]  # before its first slot it keeps none
    if said.shape[0] == 0:
        return None
    at = np.searchsorted(said[:, 0], own[:, 0], side="right") - 1
    fresh = (at >= 0) & (own[:, 0] - said[at, 0] <= TRACKING_AGE_MAX_S)
    own, at = own[fresh], at[fresh]
    if at.size == 0:
        return None
    t = own[:, 0]
    separation, phi = said[at, 2], said[at, 3]
    ahead = _predecessors(trace, t, said[at, 1])
    dx, dy = own[:, 1] - ahead[:, 1], own[:, 2] - ahead[:, 2]
    from_chi = np.arctan2(dy, dx) - _angle_at(t, said, 4)
    distance = np.hypot(dx, dy) - separation
    avoiding = said[at, 7] > 0.5
    changing = _held(_changes(said), at)
    return TrackingErrors(
        t=t,
        predecessor=said[at, 1],
        distance=distance,
        bearing=wrap(from_chi - phi),
        bearing_asked=wrap(from_chi - _asked(trace, robot, t, phi)),
        bearing_body=wrap(np.arctan2(dy, dx) - ahead[:, 3] - phi),
        heading=wrap(_angle_at(t, said, 5) - own[:, 3]),
        avoiding=avoiding,
        changing=changing,
        excused=_excused(t, avoiding | changing, np.abs(distance) >= SETTLED_M),
    )


def wrap(angle: Array) -> Array:
    """Angles [rad] brought into [-pi, pi)."""
    return np.asarray((angle + np.pi) % (2.0 * np.pi) - np.pi)


def runs(mask: Mask) -> int:
    """How many separate stretches of True there are."""
    return int(np.count_nonzero(np.diff(mask.astype(np.int8), prepend=0) == 1))


def _predecessors(trace: RecordedRun, t: Array, ids: Array) -> Array:
    """The truth of robot `ids[i]` at `t[i]`, one row each; all robots of one ground truth have the same time."""
    rows = np.empty((t.size, 6))
    for robot in np.unique(ids):
        mine = ids == robot
        truth = trace.truth[int(robot)]
        rows[mine] = truth[np.clip(np.searchsorted(truth[:, 0], t[mine]), 0, truth.shape[0] - 1)]
    return rows


def _asked(trace: RecordedRun, robot: int, t: Array, blended: Array) -> Array:
    """phi^d [rad] that the leader last asked for; until it has asked, what the follower keeps."""
    requests = trace.commanded.get(robot)
    if requests is None:
        return blended
    last = np.searchsorted(requests[:, 0], t, side="right") - 1
    return np.where(last < 0, blended, requests[np.maximum(last, 0), 2])


def _angle_at(t: Array, said: Array, column: int) -> Array:
    """An angle between two messages, on the straight line between them."""
    return np.asarray(np.interp(t, said[:, 0], np.unwrap(said[:, column])))


def _changes(said: Array) -> Mask:
    """Per message: predecessor, separation or angle differ from the message before; the first is no change."""
    before, after = said[:-1], said[1:]
    other = before[:, 1] != after[:, 1]
    moved = np.abs(after[:, 2] - before[:, 2]) > _CHANGED_M
    turned = np.abs(wrap(after[:, 3] - before[:, 3])) > _CHANGED_PHI
    return np.concatenate([[False], other | moved | turned])


def _held(of_message: Mask, at: NDArray[np.intp]) -> Mask:
    """What a message says, held over the ground truths until the next message."""
    return np.asarray(of_message[at])


def _excused(t: Array, cause: Mask, off: Mask) -> Mask:
    excused = np.zeros(t.size, dtype=bool)
    until = -np.inf
    for i in range(t.size):
        if cause[i]:
            until = t[i] + RECOVERY_S_MAX
            excused[i] = True
        elif off[i] and t[i] < until:
            excused[i] = True
        else:
            until = -np.inf
    return excused
