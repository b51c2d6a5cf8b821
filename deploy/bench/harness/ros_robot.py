"""A ROS robot as a process of its own: odometry of a unicycle, and obedience to `cmd_vel`, as a TurtleBot 3 has them.

It keeps its last velocity for ever. Run as `python -m lfa.deploy.bench.harness.ros_robot ENDPOINT NAMESPACE FILE`; each
command that arrives becomes a line `time v omega` of FILE, with the time [s] of this machine's monotonic clock.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

from lfa.deploy.ros import messages
from lfa.deploy.ros.session import RosSpace
from lfa.deploy.ros.wire import SENSOR_DATA
from lfa.protocol import clock
from lfa.protocol.geometry import Pose2D, Twist, along_arc
from lfa.protocol.transport.bus import Wake
from lfa.protocol.transport.zenoh_ros import ros_session

PERIOD_S = 0.02


def main(endpoint: str, namespace: str, log: Path) -> None:
    """Drive until the process is killed."""
    wake = Wake()
    node = RosSpace(ros_session(endpoint, serve=False), 0, "jazzy", wake).node("base", namespace)
    odom = node.publisher(f"{namespace}/odom", "nav_msgs/msg/Odometry", SENSOR_DATA)
    commands = node.subscription(f"{namespace}/cmd_vel", "geometry_msgs/msg/TwistStamped")
    pose, twist, odometer_m, at = Pose2D(), Twist(), 0.0, clock.now()
    with log.open("w", buffering=1) as lines:
        while True:
            wake.wait(max(0.0, at + PERIOD_S - clock.now()))
            for arrived, message in commands.take_timed():
                twist = Twist(message.twist.linear.x, message.twist.angular.z)
                lines.write(f"{arrived} {twist.linear_x} {twist.angular_z}\n")
            now = clock.now()
            if now - at < PERIOD_S:
                continue
            pose = along_arc(pose, twist, now - at)
            odometer_m += abs(twist.linear_x) * (now - at)
            at = now
            odom.publish(messages.odometry(time.time_ns(), pose, twist, odometer_m, "odom", "base_link"))


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], Path(sys.argv[3]))
