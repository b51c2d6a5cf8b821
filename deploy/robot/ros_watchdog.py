"""Watchdog process of a ROS robot's driver: says zero on its command topic when the driver is silent, dead or hangs.

Like `watchdog.py`, with a session of its own that is open before the driver's first command, so that the zero is not
late: some robots keep their last velocity for ever. Start: `python -m lfa.deploy.robot.ros_watchdog SILENT_S TASK`.
"""

from __future__ import annotations

import lfa.protocol.program_start.installed_first  # noqa: F401 (before any other module)

# isort: split
import signal
import struct
import sys
import time

import msgspec
from msgspec import Struct

from lfa.deploy.robot.watchdog import watch
from lfa.deploy.ros.wire import DEFAULT, RosEndpoint, RosNode, attachment
from lfa.protocol import clock
from lfa.protocol.output import write_line
from lfa.protocol.transport.zenoh_ros import ros_session

NODE = "lfa_watchdog"
ZEROS, PERIOD_S = 10, 0.02
"""Number of zeros at each stop, and the time [s] between them: best effort subscribers may miss one."""
_STAMP = struct.Struct("<iI")
STAMP_AT = 4
"""Place of a stamped message's time in its CDR: right after the encapsulation."""


class StopTask(Struct, frozen=True):
    """Where and how to say zero."""

    endpoint: str
    domain: int
    namespace: str
    topic: str
    type: str
    hash: str
    zero: bytes
    """Message of velocity zero, in CDR."""
    stamped: bool
    """True if `zero` begins with a time."""


class ZeroSpeaker:
    """Publisher of zero velocities, with a node and a session of its own."""

    def __init__(self, task: StopTask) -> None:
        """Open the session. Raises Refused."""
        self._task = task
        self._number = 0
        self._session = ros_session(task.endpoint, serve=False)
        node = RosNode(task.domain, self._session.id, 0, task.namespace, NODE)
        endpoint = RosEndpoint(node, 1, "MP", task.topic, task.type, task.hash, DEFAULT)
        self._gid = endpoint.gid
        self._publication = self._session.publisher(endpoint.key, reliable=True, kept=None)
        self._tokens = [self._session.token(node.token), self._session.token(endpoint.token)]

    @property
    def session(self) -> str:
        """Id of its session, by which its driver knows it in the ROS graph."""
        return self._session.id

    def stop(self) -> int:
        """Say zero a few times; return 0."""
        for _ in range(ZEROS):
            self._number += 1
            now_ns = time.time_ns()
            zero = bytearray(self._task.zero)
            if self._task.stamped:
                _STAMP.pack_into(zero, STAMP_AT, now_ns // 10**9, now_ns % 10**9)
            self._publication.put(bytes(zero), attachment(self._number, now_ns, self._gid))
            clock.sleep(PERIOD_S)
        return 0

    def close(self) -> None:
        self._session.close()


def main() -> int:
    """Run the watchdog on standard input, until the driver is gone."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)  # what ends the driver must not end its watchdog first
    speaker = ZeroSpeaker(msgspec.json.decode(sys.argv[2], type=StopTask))
    write_line(speaker.session, sys.stdout)
    try:
        return watch(sys.stdin.fileno(), float(sys.argv[1]), speaker.stop)
    finally:
        speaker.close()


if __name__ == "__main__":
    sys.exit(main())
