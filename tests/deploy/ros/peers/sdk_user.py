"""A ROS user by `zenoh-ros2-sdk`, which nobody here wrote: lists topics, echoes some, orders; prints JSON.

Runs in an environment of its own: `sdk_user.py PORT SECONDS TOPIC=TYPE=HASH...`.
"""

import json
import os
import sys
import time
from collections import Counter

from rosbags.typesys import Stores, get_typestore
from zenoh_ros2_sdk import ROS2Publisher, ROS2ServiceClient, ROS2Subscriber
from zenoh_ros2_sdk.discovery import get_topic_info, get_topic_names_and_types

STORE = get_typestore(Stores.ROS2_JAZZY)
TRIGGER_HASH = "RIHS01_eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f"
STRING_HASH = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"


def definition(name):
    return STORE.generate_msgdef(name, ros_version=2)[0]


def main():
    port, seconds = int(sys.argv[1]), float(sys.argv[2])
    there = {"router_port": port}
    heard, last, subscribers = Counter(), {}, []
    for wanted in sys.argv[3:]:
        topic, of_type, type_hash = wanted.split("=")

        def received(message, topic=topic):
            heard[topic] += 1
            last[topic] = message

        subscribers.append(
            ROS2Subscriber(topic, of_type, received, msg_definition=definition(of_type), type_hash=type_hash, **there)
        )
    time.sleep(seconds)
    topics = dict(get_topic_names_and_types(timeout=2.0, **there))
    info = get_topic_info("/robot1/scan", timeout=2.0, verbose=True, **there)
    said = {topic: str(message)[:2000] for topic, message in last.items()}
    called = None
    if "/lfa/leader" in heard or "/robot1/odom" in heard:
        formation = ROS2Publisher("/lfa/formation/set", "std_msgs/msg/String", msg_definition="string data", type_hash=STRING_HASH, **there)  # fmt: skip  # noqa: E501
        time.sleep(1.0)
        formation.publish(data="column")
        client = ROS2ServiceClient(
            "/lfa/handover", "std_srvs/srv/Trigger", request_definition="uint8 structure_needs_at_least_one_member",
            response_definition="bool success\nstring message", type_hash=TRIGGER_HASH, timeout=20.0, **there,
        )  # fmt: skip
        answer = client.call(structure_needs_at_least_one_member=0)
        called = None if answer is None else [bool(answer.success), str(answer.message)]
    qos = None if info is None else [str(one) for one in info.publishers]
    print(json.dumps({"topics": topics, "heard": heard, "last": said, "called": called, "scan": qos}))
    sys.stdout.flush()
    os._exit(0)  # its session keeps threads that never end


if __name__ == "__main__":
    main()
