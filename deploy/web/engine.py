"""What the page's server asks of an engine: a team in virtual time, a running fleet, or a recording."""

from __future__ import annotations

from math import hypot
from typing import Any, Protocol

from lfa.deploy.view.picture.picture import Picture
from lfa.protocol.errors import Refused


class Engine(Protocol):
    """Source of pictures that takes orders."""

    @property
    def pictures(self) -> list[Picture]:
        """One picture for each team that the page shows, at most two."""

    @property
    def number(self) -> int:
        """Number of the present run; the page begins anew when it changes."""

    def scene(self) -> dict[str, Any]:
        """Return what does not change during the run."""

    def state(self) -> dict[str, Any]:
        """Return the state of the controls."""

    def advance(self) -> None:
        """Take in what has come since the last call."""

    def obey(self, order: dict[str, Any]) -> dict[str, Any]:
        """Carry out an order of the page and return the answer. Raises Refused."""

    def close(self) -> None:
        """Release what the engine holds."""


class RecordingEngine:
    """Engine of a page that plays a recording by itself: it has nothing to say."""

    number = 0

    @property
    def pictures(self) -> list[Picture]:
        return []

    def scene(self) -> dict[str, Any]:
        return {"engine": "recording", "title": "", "panes": []}

    def state(self) -> dict[str, Any]:
        return {}

    def advance(self) -> None:
        """Do nothing."""

    def obey(self, order: dict[str, Any]) -> dict[str, Any]:
        raise Refused(f"{str(order.get('do'))[:20]}: a recording takes no orders")

    def close(self) -> None:
        """Do nothing."""


def robot_under(picture: Picture, robots: tuple[int, ...], x: float, y: float, apart_m: float) -> int | None:
    """Return a robot closer than `apart_m` to a place [m], None if there is none."""
    for robot in robots:
        at = picture.where(robot)
        if at is not None and hypot(at[0] - x, at[1] - y) < apart_m:
            return robot
    return None
