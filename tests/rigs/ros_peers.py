"""Two ROS sessions in one process: a router as `lfa ros --serve` opens it, and a client of it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from socket import socket
from typing import TypeVar

from lfa.deploy.ros.session import RosSpace
from lfa.deploy.ros.wire import Distro
from lfa.protocol import clock
from lfa.protocol.transport.bus import Wake
from lfa.protocol.transport.zenoh_ros import ros_session

PATIENCE_S = 20.0
T = TypeVar("T")


def free_endpoint() -> str:
    """Return a TCP endpoint on loopback that nobody listens at."""
    with socket() as free:
        free.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{free.getsockname()[1]}"


@contextmanager
def ros_pair(distro: Distro = "jazzy") -> Iterator[tuple[RosSpace, RosSpace]]:
    """Yield the space of a router and that of a client of it, both in domain 0."""
    endpoint = free_endpoint()
    served = ros_session(endpoint, serve=True)
    try:
        with ros_client(endpoint, distro) as used:
            yield RosSpace(served, 0, distro, Wake()), used
    finally:
        served.close()


@contextmanager
def ros_client(endpoint: str, distro: Distro = "jazzy") -> Iterator[RosSpace]:
    """Yield the space of a client of the ROS router at `endpoint`, in domain 0."""
    session = ros_session(endpoint, serve=False)
    try:
        yield RosSpace(session, 0, distro, Wake())
    finally:
        session.close()


def awaited(found: Callable[[], T], what: str) -> T:
    """Return the first true value of `found`. Raises AssertionError after PATIENCE_S."""
    until = clock.now() + PATIENCE_S
    while clock.now() < until:
        value = found()
        if value:
            return value
        clock.sleep(0.01)
    raise AssertionError(f"{what}: not within {PATIENCE_S:g} s")
