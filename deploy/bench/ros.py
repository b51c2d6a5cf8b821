"""Bench `ros`: what the bridge to ROS 2 costs, how late its topics come, and how a ROS robot does as a member."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from fnmatch import fnmatchcase
from itertools import chain
from socket import socket

from lfa.deploy.bench.harness.ros_bridge import bridge_rows
from lfa.deploy.bench.harness.ros_member import member_rows
from lfa.deploy.bench.harness.rows import BenchRow, show
from lfa.protocol.errors import Refused


def run(as_json: bool, rows: str = "*") -> int:
    """Print the rows of the groups `bridge` and `member` that match; return 0 if all hold, else 1."""
    groups: dict[str, Callable[[], Iterator[list[BenchRow]]]] = {
        "bridge": lambda: bridge_rows(_free_endpoint(), _free_endpoint()),
        "member": lambda: member_rows(_free_endpoint()),
    }
    chosen = [group for name, group in groups.items() if fnmatchcase(name, rows.split("/")[0])]
    if not chosen:
        raise Refused(f"--rows {rows!r}: no row has such a name; they begin with {', '.join(groups)}")
    return show(chain.from_iterable(group() for group in chosen), as_json)


def _free_endpoint() -> str:
    with socket() as free:
        free.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{free.getsockname()[1]}"
