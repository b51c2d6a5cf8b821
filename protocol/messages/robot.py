"""Messages between a robot's hardware, or its simulation, and its agent."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta, Struct

from lfa.protocol.geometry import Number, Pose2D, Twist
from lfa.protocol.messages.consensus import GatewayStamp, Term
from lfa.protocol.messages.header import Count, Header, Step
from lfa.protocol.messages.stop import UNCERTAIN, StopKnowledge

UNSAID_GRANT_S = 0.0
"""`grant_s` of a message of version 5 (E35), which does not say it: it is not compared."""

SENSOR_NAME_MAX, SENSOR_VALUES_MAX = 64, 64
"""Longest name of a sensor of a user's own or of one of its values, and the largest number of its values."""
SensorName = Annotated[str, Meta(max_length=SENSOR_NAME_MAX)]


class Sensors(Struct, frozen=True, array_like=True, tag="sensors"):
    """Wheel odometry and gateway state at `header.stamp` on the driver's clock."""

    header: Header
    pose_odom: Pose2D
    twist: Twist
    odometer_m: Number
    gateway: GatewayStamp
    term_max: Term
    latched: bool = False
    refused: int = 0
    agent: Count | None = None
    """Newest incarnation of the robot's agent that the gateway knows (E23); None before the first."""
    stop: StopKnowledge = UNCERTAIN
    """What the gateway knows of the fleet stop (E28)."""
    stands: bool = False
    """True while the gateway lets no wheel turn: stopped, not certain yet, or without an operator (E28, E31)."""
    grant_s: Number = UNSAID_GRANT_S
    """`T_grant` [s] of the gateway: an agent takes no sensors from one that holds another than its team (E25)."""


class Localization(Struct, frozen=True, array_like=True, tag="localization"):
    """Fix of a localization in `map`."""

    header: Header
    pose_map: Pose2D
    sigma_m: Number = 0.0
    """Standard deviation [m] of the position, in its worse axis; 0: as good as the agent assumes."""
    sigma_rad: Number = 0.0


NEAR_M_MAX = 0.5
"""Range [m] that a scanner must be able to measure: one that begins to see farther off shows no way past anything."""


class LaserScan(Struct, frozen=True, array_like=True, tag="scan"):
    """Laser scan by REP-117: beyond `range_max_m` is +inf, below `range_min_m` is -inf, a bad reading is nan."""

    header: Header
    angle_min: Number
    angle_increment: Number
    range_min_m: Number
    range_max_m: Number
    ranges_m: tuple[float, ...]


class GroundProfile(Struct, frozen=True, array_like=True, tag="ground"):
    """Height profile of the floor ahead, along three lines parallel to the direction of travel.

    The lines belong to the left wheel, the centre and the right wheel; the floor beside all three is not crossed.
    Point j of line i is at x = `first_m` + j `increment_m`, y = `offsets_m[i]` in `base_link`; its height [m] is
    relative to the floor under the wheels, negative for a hole. In the spirit of REP-117, a bad or missing reading
    is nan and a floor deeper than the sensor's range is -inf. Walls and bodies are not floor and do not appear.
    """

    header: Header
    first_m: Number
    increment_m: Step
    offsets_m: tuple[Number, ...]
    heights_m: tuple[tuple[float, ...], ...]
    """Heights [m], one row per line."""


class Contact(Struct, frozen=True, array_like=True, tag="contact"):
    """Bumper contact; `bearing` is the direction of the touch [rad] in `base_link`."""

    header: Header
    bearing: Number


class SensorReading(Struct, frozen=True, array_like=True, tag="reading"):
    """Measurement of a sensor of a user's own, called `sensor`: its values by the names that its class gives them."""

    header: Header
    sensor: SensorName
    values: Annotated[dict[SensorName, Number], Meta(max_length=SENSOR_VALUES_MAX)]


class CmdVel(Struct, frozen=True, array_like=True, tag="cmd_vel"):
    """Velocity command. `as_leader` is True if the sender commands as holder of the lease."""

    header: Header
    twist: Twist
    term: Term
    holder: Count
    as_leader: bool
    gateway: GatewayStamp
    stop: StopKnowledge = UNCERTAIN
    """What the agent knows of the fleet stop: a gateway that has restarted learns it from here (E30)."""
    grant_s: Number = UNSAID_GRANT_S
    """`T_grant` [s] that the sender's lease counts on: a gateway with another one refuses (E25)."""
