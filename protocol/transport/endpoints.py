"""Syntax of endpoints: `tcp/127.0.0.1:7447`, `unixsock-stream//run/lfa.sock`; several are written `a,b`."""

from __future__ import annotations

import re

from lfa.protocol.errors import Refused

PORT_MAX = 65535
CERTIFIED = ("tls", "quic")
_NETWORKED = re.compile(r"(tcp|udp|tls|quic|ws)/(\[[^\]/]+\]|[^:/\[\]]+):(\d+)([?#].*)?")
_ON_DISK = re.compile(r"unixsock-stream/[^?#]+")


def check_endpoints(endpoints: str, where: str) -> None:
    """Raise Refused for an endpoint at which no router could listen or be reached; `where` is the option's name.

    Zenoh itself distinguishes an invalid port from an absent router only by the error text.
    """
    for endpoint in endpoints.split(","):
        networked = _NETWORKED.fullmatch(endpoint)
        if networked is None and _ON_DISK.fullmatch(endpoint) is None:
            raise Refused(f"{where} {endpoint}: must be like tcp/127.0.0.1:7447 or unixsock-stream//run/lfa.sock")
        if networked is not None and int(networked[3]) > PORT_MAX:
            raise Refused(f"{where} {endpoint}: port {networked[3]} must be {PORT_MAX} or lower")
        if where == "connect" and networked is not None and networked[1] in CERTIFIED and networked[2].startswith("["):
            why = "Zenoh makes no certified link to an address of IPv6"
            raise Refused(f"{where} {endpoint}: must have a name or an address of IPv4, or be tcp/: {why}")
