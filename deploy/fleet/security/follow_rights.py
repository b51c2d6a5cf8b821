"""Which key expressions a member may subscribe to (pure).

A router refuses others before it keeps anything of them. An expression counts as listed if a listed one includes it:
`lfa/f/r$*t1/table` by `lfa/f/*/table`. So this bounds what a member hears, and not how often it declares that.
"""

from __future__ import annotations

from collections.abc import Iterable

from lfa.agents.subscriptions import before_the_mission, with_mission
from lfa.deploy.robot.driver import heard_by_driver
from lfa.protocol.names import WITNESS_NAME, robot_id_of
from lfa.protocol.runtime.namesakes import said_by
from lfa.protocol.topics import DRIVER_PREFIX, OPERATOR_NAME, key
from lfa.protocol.transport.spelling import spellings
from lfa.protocol.witness import heard_by_witness


def followable(name: str, fleet: str, robots: Iterable[int]) -> list[str] | None:
    """Return all that `name` may subscribe to in a fleet of these `robots`, in each of its spellings; None: anything.

    A robot, its driver and a witness have such a list; world, machines and persons are not bounded. Liveliness tokens,
    which other rules admit, are not in it.
    """
    followed = _followed(name, fleet, robots)
    if followed is None:
        return None
    always = said_by(fleet, name) | {key(fleet, OPERATOR_NAME, "operator")}
    plain = {one for one in followed | always if "/alive/" not in one}
    return sorted({spelled for one in plain for spelled in spellings(one, name)})


def _followed(name: str, fleet: str, robots: Iterable[int]) -> frozenset[str] | None:
    if name == WITNESS_NAME:
        return heard_by_witness(fleet)
    if (robot := robot_id_of(name.replace(DRIVER_PREFIX, "robot", 1))) is None:
        return None
    if name.startswith(DRIVER_PREFIX):
        return heard_by_driver(fleet, robot)
    ahead = (with_mission(fleet, name, other, asks=True) for other in robots)
    return before_the_mission(fleet).union(*ahead)
