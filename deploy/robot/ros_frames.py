"""Planar transform tree of a ROS robot: from /tf and /tf_static to `odom` in `map` and the scanner's mount. Pure."""

from __future__ import annotations

from typing import Any

from msgspec import Struct

from lfa.agents.localization.plausibility import plausible
from lfa.deploy.ros.quaternions import is_tilted, yaw_of
from lfa.protocol.geometry import STILL, Pose2D, between, compose

FRAMES_MAX = 1000


class Frame(Struct, frozen=True):
    """One frame in its parent, and when it was heard [s]."""

    parent: str
    at: Pose2D
    heard_at: float


class FrameTree:
    """Newest transform of each frame; others than planar ones are counted and dropped."""

    def __init__(self) -> None:
        self._frames: dict[str, Frame] = {}
        self.dropped = 0
        self.tilted: set[str] = set()
        """Frames that are not level: a scanner there measures no horizontal plane."""

    def update(self, message: Any, now: float) -> None:
        """Take a tf2_msgs/TFMessage."""
        for one in message.transforms:
            move, turn = one.transform.translation, one.transform.rotation
            child, parent = _plain(one.child_frame_id), _plain(one.header.frame_id)
            full = len(self._frames) >= FRAMES_MAX and child not in self._frames
            yaw = yaw_of(turn)
            if yaw is None or not plausible(Pose2D(move.x, move.y, yaw), STILL) or full:
                self.dropped += 1
                continue
            if is_tilted(turn):
                self.tilted.add(child)
            self._frames[child] = Frame(parent, Pose2D(move.x, move.y, yaw), now)

    def direct(self, parent: str, child: str) -> Frame | None:
        """Return the transform of `child` if its parent is `parent`."""
        found = self._frames.get(_plain(child))
        return found if found is not None and found.parent == _plain(parent) else None

    def between(self, base: str, other: str) -> Pose2D | None:
        """Return `other` in `base`, over any common ancestor; None if they are not connected."""
        of_base, of_other = self._path(_plain(base)), self._path(_plain(other))
        for root, base_in_root in of_base.items():
            if root in of_other:
                return between(base_in_root, of_other[root])
        return None

    def is_tilted(self, frame: str, root: str) -> bool:
        """Return True if `frame`, or one between it and the frames of `root`, is not level."""
        return any(name in self.tilted for name in self._path(_plain(frame)) if name not in self._path(_plain(root)))

    def _path(self, frame: str) -> dict[str, Pose2D]:
        """Return the pose of `frame` in itself and in each of its ancestors, nearest first."""
        poses = {frame: Pose2D()}
        while (link := self._frames.get(frame)) is not None and link.parent not in poses:
            poses[link.parent] = compose(link.at, poses[frame])
            frame = link.parent
        return poses


def _plain(frame: str) -> str:
    return frame.removeprefix("/")
