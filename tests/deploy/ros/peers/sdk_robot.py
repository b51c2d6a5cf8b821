"""A ROS robot by `zenoh-ros2-sdk`, which nobody here wrote: odom, scan and cmd_vel, as a TurtleBot 3 has them.

Like a TurtleBot 3 it keeps its last velocity for ever. Each command is written to a file as a line `time v omega`.
Runs in an environment of its own: `sdk_robot.py PORT NAMESPACE FILE`.
"""

import sys
import threading
import time
from math import cos, sin

import numpy as np
from sdk_user import definition
from zenoh_ros2_sdk import ROS2Publisher, ROS2Subscriber

HASHES = {
    "nav_msgs/msg/Odometry": "3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0",
    "sensor_msgs/msg/LaserScan": "64c191398013af96509d518dac71d5164f9382553fce5c1f8cca5be7924bd828",
    "geometry_msgs/msg/TwistStamped": "5f0fcd4f81d5d06ad9b4c4c63e3ea51b82d6ae4d0558f1d475229b1121db6f64",
}
PERIOD_S, SCAN_EVERY, BEAMS = 0.02, 5, 36


def about(of_type):
    return {"msg_definition": definition(of_type), "type_hash": f"RIHS01_{HASHES[of_type]}"}


class Robot:
    def __init__(self, port, namespace, log):
        self.v = self.omega = self.x = self.y = self.theta = 0.0
        self.log = log
        self.lock = threading.Lock()
        there = {"router_port": port, "node_name": "base", "namespace": namespace}
        odom, scan, twist = "nav_msgs/msg/Odometry", "sensor_msgs/msg/LaserScan", "geometry_msgs/msg/TwistStamped"
        self.odom = ROS2Publisher(f"{namespace}/odom", odom, **about(odom), **there)
        self.scan = ROS2Publisher(f"{namespace}/scan", scan, **about(scan), **there)
        self.commands = ROS2Subscriber(f"{namespace}/cmd_vel", twist, self.obey, **about(twist), **there)
        self.types = self.odom.session_mgr.store.types

    def make(self, name, *values):
        return self.types[name](*values)

    def obey(self, message):
        with self.lock:
            self.v, self.omega = message.twist.linear.x, message.twist.angular.z
        print(time.time(), self.v, self.omega, file=self.log, flush=True)

    def header(self, frame):
        now_ns = time.time_ns()
        stamp = self.make("builtin_interfaces/msg/Time", now_ns // 10**9, now_ns % 10**9)
        return self.make("std_msgs/msg/Header", stamp, frame)

    def step(self, dt):
        with self.lock:
            v, omega = self.v, self.omega
        middle = self.theta + 0.5 * omega * dt
        self.x, self.y, self.theta = (
            self.x + v * dt * cos(middle),
            self.y + v * dt * sin(middle),
            self.theta + omega * dt,
        )
        vector, pose = "geometry_msgs/msg/Vector3", "geometry_msgs/msg/Pose"
        place = self.make("geometry_msgs/msg/Point", self.x, self.y, 0.0)
        turn = self.make("geometry_msgs/msg/Quaternion", 0.0, 0.0, sin(0.5 * self.theta), cos(0.5 * self.theta))
        twist = self.make("geometry_msgs/msg/Twist", self.make(vector, v, 0.0, 0.0), self.make(vector, 0.0, 0.0, omega))
        zero = np.zeros(36)
        self.odom.publish(
            header=self.header("odom"), child_frame_id="base_link",
            pose=self.make("geometry_msgs/msg/PoseWithCovariance", self.make(pose, place, turn), zero),
            twist=self.make("geometry_msgs/msg/TwistWithCovariance", twist, zero),
        )  # fmt: skip

    def look(self):
        self.scan.publish(
            header=self.header("base_link"), angle_min=-3.14, angle_max=3.14, angle_increment=6.28 / BEAMS,
            time_increment=0.0, scan_time=0.1, range_min=0.1, range_max=10.0,
            ranges=np.full(BEAMS, np.inf, dtype=np.float32), intensities=np.zeros(0, dtype=np.float32),
        )  # fmt: skip


def main():
    with open(sys.argv[3], "w") as log:
        robot = Robot(int(sys.argv[1]), sys.argv[2], log)
        print("ready", flush=True)
        due = last = time.monotonic()
        count = 0
        while True:
            now = time.monotonic()
            robot.step(now - last)
            last = now
            if count % SCAN_EVERY == 0:
                robot.look()
            count += 1
            due = max(due + PERIOD_S, now)
            time.sleep(due - now)


main()
