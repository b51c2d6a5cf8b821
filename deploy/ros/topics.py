"""The table of ROS topics that a fleet appears as: type, QoS and source of each, per robot and of the whole fleet."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import lru_cache

from msgspec import Struct

from lfa.deploy.ros.wire import DEFAULT, LATCHED, ROSOUT, SENSOR_DATA, Qos


class RosTopic(Struct, frozen=True):
    """Row of the table; `{ns}` in the name stands for a robot's namespace, like `/robot3`."""

    name: str
    type: str
    qos: Qos
    source: str
    """The fleet's topics that it is made from."""


TF_QOS = Qos(depth=100)
CLOCK_QOS = Qos(depth=1, reliable=False)

#            name                       type                                  QoS          source
ROBOT_TOPICS = (
    RosTopic("{ns}/odom",              "nav_msgs/msg/Odometry",              DEFAULT,     "sensors"),
    RosTopic("{ns}/scan",              "sensor_msgs/msg/LaserScan",          SENSOR_DATA, "scan"),
    RosTopic("{ns}/pose",              "geometry_msgs/msg/PoseStamped",      DEFAULT,     "pose"),
    RosTopic("{ns}/cmd_vel",           "geometry_msgs/msg/TwistStamped",     DEFAULT,     "cmd_vel, sensors"),
    RosTopic("{ns}/trail",             "nav_msgs/msg/Path",                  LATCHED,     "pose"),
    RosTopic("{ns}/plan",              "nav_msgs/msg/Path",                  LATCHED,     "plan, mission"),
    RosTopic("{ns}/robot_description", "std_msgs/msg/String",                LATCHED,     "mission"),
)  # fmt: skip
FLEET_TOPICS = (
    RosTopic("/map",                   "nav_msgs/msg/OccupancyGrid",         LATCHED,     "plan"),
    RosTopic("/diagnostics",           "diagnostic_msgs/msg/DiagnosticArray", DEFAULT,    "status, tracking"),
    RosTopic("/lfa/formation",         "visualization_msgs/msg/MarkerArray", DEFAULT,     "tracking, pose, obstacles"),
    RosTopic("/lfa/leader",            "std_msgs/msg/Int32",                 LATCHED,     "pose"),
    RosTopic("/lfa/chain",             "std_msgs/msg/String",                LATCHED,     "lease"),
    RosTopic("/rosout",                "rcl_interfaces/msg/Log",             ROSOUT,      "event"),
)  # fmt: skip
TF = (
    RosTopic("/tf",                    "tf2_msgs/msg/TFMessage",             TF_QOS,      "sensors, pose"),
    RosTopic("/tf_static",             "tf2_msgs/msg/TFMessage",             LATCHED,     "-"),
)  # fmt: skip
"""With frames `robotN/odom` and `robotN/base_link` on the global topics, or with `--tf-per-robot` as topics of each
robot, with frames `odom` and `base_link`."""
CLOCK = RosTopic("/clock", "rosgraph_msgs/msg/Clock", CLOCK_QOS, "truth, with --sim-time")

SOURCES = frozenset({
    "*/sensors", "*/scan", "*/pose", "*/cmd_vel", "*/tracking", "*/plan", "*/mission", "*/status", "*/event",
    "*/obstacles", "*/lease/all",
})  # fmt: skip
"""Key expressions, without the fleet's part, of all topics that the table is made from; votes are not among them."""
WORLD_TIME = "sim/truth"
"""Source of `/clock` and of stamps in the world's time."""
ON_DEMAND = frozenset({"*/sensors", "*/scan", "*/cmd_vel", "*/tracking"})
"""Those of SOURCES whose topics are not latched: a bridge hears them while somebody hears what it makes of them."""
_ROBOTS_KEPT = 512


def sources_heard(robots: Iterable[int], heard: Callable[[str], bool], *, tf_per_robot: bool) -> frozenset[str]:
    """Return those of ON_DEMAND that are needed for the topics of `robots` and of the fleet that somebody hears."""
    rows = [*fleet_topics(tf_per_robot=tf_per_robot, sim_time=False)]
    for robot in robots:
        rows += robot_topics(robot, tf_per_robot=tf_per_robot)
    needed = {row.source for row in rows if not row.qos.latched and heard(row.name)}
    return ON_DEMAND & {f"*/{name}" for source in needed for name in source.split(", ")}


@lru_cache(maxsize=_ROBOTS_KEPT)
def robot_topics(robot: int, *, tf_per_robot: bool) -> tuple[RosTopic, ...]:
    """Return the topics of one robot."""
    rows = (*ROBOT_TOPICS, *TF) if tf_per_robot else ROBOT_TOPICS
    return tuple(_named(row, f"/robot{robot}") for row in rows)


def fleet_topics(*, tf_per_robot: bool, sim_time: bool) -> tuple[RosTopic, ...]:
    """Return the topics of the fleet as a whole."""
    return (*FLEET_TOPICS, *(() if tf_per_robot else TF), *((CLOCK,) if sim_time else ()))


def _named(row: RosTopic, namespace: str) -> RosTopic:
    name = row.name.replace("{ns}", namespace) if "{ns}" in row.name else f"{namespace}{row.name}"
    return RosTopic(name, row.type, row.qos, row.source)
