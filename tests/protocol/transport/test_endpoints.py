"""What is no endpoint is refused in words, before anybody waits for a router there."""

import pytest

from lfa.protocol.errors import Refused
from lfa.protocol.transport.endpoints import check_endpoints


@pytest.mark.parametrize(
    "good",
    [
        "tcp/127.0.0.1:7447",
        "tcp/machine-a:0",
        "tcp/[::1]:7447",
        "quic/10.0.0.1:7447?rel=0",
        "unixsock-stream//run/lfa.sock",
        "unixsock-stream/relative.sock",
        "unixsock-stream//run/lfa.sock,tcp/127.0.0.1:7447",
    ],
)
def test_what_a_router_can_be_reached_at_is_taken(good: str) -> None:
    check_endpoints(good, "connect")


@pytest.mark.parametrize(
    "bad",
    [
        "",
        "foo",
        "tcp/1.2.3.4",
        "tcp/1.2.3.4:bad",
        "tcp/:7447",
        "tcp/1.2.3.4:65536",
        "tcp/1.2.3.4:-1",
        "http/1.2.3.4:80",
        "unixsock-stream/",
        "tcp/127.0.0.1:7447,foo",
        "tls/[::1]:7447",
        "quic/[fd00::1]:7447",
    ],
)
def test_anything_else_is_refused_with_the_option_that_gave_it(bad: str) -> None:
    with pytest.raises(Refused, match=r"^connect "):
        check_endpoints(bad, "connect")


def test_a_certified_link_to_an_address_of_ipv6_is_refused_with_the_reason_in_place_of_waiting_for_ever() -> None:
    with pytest.raises(Refused, match="Zenoh makes no certified link to an address of IPv6"):
        check_endpoints("unixsock-stream//run/lfa.sock,tls/[::1]:7447", "connect")
    check_endpoints("quic/[::]:7447", "listen")
