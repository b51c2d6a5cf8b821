"""Key expressions that one agent subscribes to (pure)."""

from __future__ import annotations

from lfa.protocol.names import robot_name
from lfa.protocol.topics import TO_ALL, TO_HELLO, TOPIC, alive_key, key


def before_the_mission(fleet: str) -> frozenset[str]:
    """Return the interests of an agent that waits for its mission."""
    return frozenset({f"lfa/{fleet}/*/mission", f"lfa/{fleet}/*/operator"})


def with_mission(fleet: str, own: str, predecessor: int | None, *, asks: bool) -> frozenset[str]:
    """Return the interests of robot `own`: the team, its own hardware, and the pose of the robot that it follows.

    `asks`: it also hears what other agents answer about the fleet stop.
    """
    topics = ("table", "formation", "obstacles", "stop", "ask", "team_order", *(("stop_known",) if asks else ()))
    others = {f"lfa/{fleet}/*/{topic}" for topic in topics}
    lease = {f"lfa/{fleet}/*/lease/{to}" for to in (TO_ALL, TO_HELLO, own)} | {alive_key(fleet, "*", "*")}
    hardware = {key(fleet, own, topic) for topic in ("sensors", "localization", "scan", "ground", "reading")}
    pose = set() if predecessor is None else {f"lfa/{fleet}/{robot_name(predecessor)}/{TOPIC['pose'].name}"}
    return before_the_mission(fleet) | others | lease | hardware | pose
