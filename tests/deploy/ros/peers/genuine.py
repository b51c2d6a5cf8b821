"""Genuine ROS 2 wheels as an oracle: reads `{type: hex of CDR}` on stdin, prints each message's CDR again and its hash.

Runs in an environment of its own, which holds rclpy and the message packages.
"""

import json
import sys
from importlib import import_module
from pathlib import Path

from rclpy.serialization import deserialize_message, serialize_message


def described(package, kind, name):
    """Return the hash in the type's own JSON; None for a package that has none here."""
    path = Path(sys.prefix, "share", package, kind, f"{name}.json")
    if path.is_file():
        hashes = json.loads(path.read_text())["type_hashes"]
        return next(one["hash_string"] for one in hashes if one["type_name"] == f"{package}/{kind}/{name}")
    return None


def main():
    answers = {}
    for full, hexed in json.load(sys.stdin).items():
        package, kind, name = full.split("/")
        try:
            of_type = getattr(import_module(f"{package}.{kind}"), name)
        except ImportError:
            answers[full] = None
            continue
        again = None
        if hexed is not None:
            again = serialize_message(deserialize_message(bytes.fromhex(hexed), of_type)).hex()
        answers[full] = {"cdr": again, "hash": described(package, kind, name)}
    print(json.dumps(answers))


main()
