"""What an endpoint looks like: `tcp/127.0.0.1:7447`, `unixsock-stream//run/lfa.sock`; several are written `a,b`."""

from __future__ import annotations

import re

from lfa.protocol.errors import Refused

PORT_MAX = 65535
_NETWORKED = re.compile(r"(tcp|udp|tls|quic|ws)/(\[[^\]/]+\]|[^:/\[\]]+):(\d+)([?#].*)?")
_ON_DISK = re.compile(r"unixsock-stream/[^?#]+")


def check_endpoints(endpoints: str, where: str) -> None:
    """Refuse what no router could be reached or listen at; `where` is the option that it was given by.

    Zenoh itself tells a port that is none from a router that is not there yet by its text only. Raises Refused.
    """
    for endpoint in endpoints.split(","):
        networked = _NETWORKED.fullmatch(endpoint)
        if networked is None and _ON_DISK.fullmatch(endpoint) is None:
            raise Refused(f"{where} {endpoint}: must be like tcp/127.0.0.1:7447 or unixsock-stream//run/lfa.sock")
        if networked is not None and int(networked[3]) > PORT_MAX:
            raise Refused(f"{where} {endpoint}: port {networked[3]} must be {PORT_MAX} or lower")
