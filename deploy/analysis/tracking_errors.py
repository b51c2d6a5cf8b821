"""Tracking errors of each follower, from ground truth at equal times and the commanded place in the formation.

`distance` = D - k^d, `bearing` relative to the blended slot (chi + phi), `bearing_asked` relative to the slot of the
leader's last request (chi + phi^d), `bearing_body` relative to theta_P + phi (the paper's), `heading` = wrap(psi_r -
theta_F) (control.md, equation table). Commanded values come from the follower's `tracking` messages and the leader's
requests, true poses from the world.
"""

from __future__ import annotations

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

from lfa.deploy.recording.mcap_reader import Array, RecordedRun

Mask = NDArray[np.bool_]

TRACKING_AGE_MAX_S = 0.2
"""Maximum age [s] of a `tracking` message that is compared with ground truth: five periods."""
SETTLED_M = 0.05
"""Distance error [m] below which a follower has settled."""
RECOVERY_S_MAX = 8.0
"""Maximum time [s] to recover from an avoidance or a change of place in the formation (control.md section 6)."""
_CHANGED_PHI = 1e-6
_CHANGED_M = 1e-6


class TrackingErrors(Struct):
    """Errors of one follower in [s], [m], [rad]: one entry for each ground truth record while it followed a robot."""

    t: Array
    predecessor: Array
    distance: Array
    bearing: Array
    bearing_asked: Array
    bearing_body: Array
    heading: Array
    avoiding: Mask
    changing: Mask
    """Samples with a changing place in the formation: another predecessor, separation or angle."""
    excused: Mask
    """Samples while avoiding or changing, and until back within `SETTLED_M`, for `RECOVERY_S_MAX` at most."""

    @property
    def settled_after_s(self) -> float | None:
        """Time [s] after which the distance error stays within `SETTLED_M`, excused times left out; None if never."""
        bad = np.flatnonzero((np.abs(self.distance) >= SETTLED_M) & ~self.excused)
        if bad.size == 0:
            return float(self.t[0]) if self.t.size else None
        return float(self.t[bad[-1] + 1]) if bad[-1] + 1 < self.t.size else None

    @property
    def steady(self) -> Mask:
        """Mask of the samples for rms values: settled and not excused."""
        settled = self.settled_after_s
        return (self.t >= settled) & ~self.excused if settled is not None else np.zeros(self.t.size, dtype=bool)


def of_follower(trace: RecordedRun, robot: int) -> TrackingErrors | None:
    """Compute the tracking errors of `robot`; None when it never followed another robot."""
    own, said = trace.truth.get(robot), trace.tracking.get(robot)
    if own is None or said is None:
        return None
    said = said[np.isin(said[:, 1], list(trace.truth)) & (said[:, 2] > 0.0)]  # no separation before the first slot
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
    """Return the angles [rad] wrapped to [-pi, pi)."""
    return np.asarray((angle + np.pi) % (2.0 * np.pi) - np.pi)


def runs(mask: Mask) -> int:
    """Return the number of separate intervals of True."""
    return int(np.count_nonzero(np.diff(mask.astype(np.int8), prepend=0) == 1))


def _predecessors(trace: RecordedRun, t: Array, ids: Array) -> Array:
    """Return the ground truth of robot `ids[i]` at `t[i]`, shape (n, 6); robots of one record share the same time."""
    rows = np.empty((t.size, 6))
    for robot in np.unique(ids):
        mine = ids == robot
        truth = trace.truth[int(robot)]
        rows[mine] = truth[np.clip(np.searchsorted(truth[:, 0], t[mine]), 0, truth.shape[0] - 1)]
    return rows


def _asked(trace: RecordedRun, robot: int, t: Array, blended: Array) -> Array:
    """Return phi^d [rad] of the leader's last request; before the first request, the follower's blended phi."""
    requests = trace.commanded.get(robot)
    if requests is None:
        return blended
    last = np.searchsorted(requests[:, 0], t, side="right") - 1
    return np.where(last < 0, blended, requests[np.maximum(last, 0), 2])


def _angle_at(t: Array, said: Array, column: int) -> Array:
    """Return the angle [rad] at `t` [s], linearly interpolated between two messages."""
    return np.asarray(np.interp(t, said[:, 0], np.unwrap(said[:, column])))


def _changes(said: Array) -> Mask:
    """Return per message if predecessor, separation or angle differ from the message before; False for the first."""
    before, after = said[:-1], said[1:]
    other = before[:, 1] != after[:, 1]
    moved = np.abs(after[:, 2] - before[:, 2]) > _CHANGED_M
    turned = np.abs(wrap(after[:, 3] - before[:, 3])) > _CHANGED_PHI
    return np.concatenate([[False], other | moved | turned])


def _held(of_message: Mask, at: NDArray[np.intp]) -> Mask:
    """Return the value of each message, held for the ground truth records until the next message."""
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
