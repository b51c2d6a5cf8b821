"""The door before a router's TLS listener lets in who begins a handshake, however many others stand before it."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import ExitStack

import pytest

from lfa.protocol.transport.tls_door import (
    FAILURES_BURST,
    FAILURES_HZ,
    HANDSHAKE_RECORD,
    HELLO_S,
    RETRY,
    WAITING_ALL_MAX,
    WAITING_MAX,
    Failures,
    Handshake,
    TlsDoor,
    Waiting,
    hello_length,
)
from tests.rigs.secured_fleet import free_port

HELLO = bytes([HANDSHAKE_RECORD]) + b"\x03\x01\x00\x06\x01hello"


@pytest.fixture
def inner() -> Iterator[socket.socket]:
    """What stands for Zenoh's listener behind the door."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        listener.settimeout(20.0)
        yield listener


@pytest.fixture
def public(inner: socket.socket) -> Iterator[tuple[str, int]]:
    where = ("127.0.0.1", free_port())
    door = TlsDoor(*where, [inner.getsockname()])
    yield where
    door.close()


def _knock(where: tuple[str, int], said: bytes = b"") -> socket.socket:
    knocking = socket.create_connection(where, 20.0)
    knocking.sendall(said)
    return knocking


def test_who_begins_a_handshake_is_relayed_both_ways_past_any_number_of_silent_ones(
    public: tuple[str, int], inner: socket.socket
) -> None:
    with ExitStack() as silent:
        for _ in range(2 * WAITING_ALL_MAX):
            silent.enter_context(_knock(public))
        with _knock(public, HELLO) as member, inner.accept()[0] as inside:
            assert inside.recv(100) == HELLO
            inside.sendall(b"answer")
            assert member.recv(100) == b"answer"
            inside.close()
            assert member.recv(100) == b"", "the end of the router's link is seen at once"


@pytest.mark.parametrize("said", [b"", b"GET / HTTP/1.1\r\n\r\n", HELLO[:1], HELLO[:5], HELLO[:-1]])
def test_silent_ones_and_other_languages_are_shown_out_and_never_reach_zenoh(
    said: bytes, public: tuple[str, int], inner: socket.socket
) -> None:
    with _knock(public, said) as stranger:
        assert stranger.recv(1) == b""
    with _knock(public, HELLO), inner.accept()[0] as inside:
        assert inside.recv(100) == HELLO, "the first that came is the one that began a handshake"


def test_the_oldest_silent_connection_of_an_address_gives_way_to_its_newest() -> None:
    waiting = Waiting()
    assert waiting.add(1, "other", 0.0) is None
    assert {waiting.add(10 + n, "attacker", 0.1) for n in range(WAITING_MAX)} == {None}
    assert waiting.add(99, "attacker", 0.2) == 10, "and not the other's, which is older"
    assert waiting.overdue(HELLO_S + 0.05) == [1]


def test_all_addresses_together_hold_a_bounded_number() -> None:
    waiting = Waiting()
    yielded = [waiting.add(n, f"address{n}", 0.0) for n in range(WAITING_ALL_MAX + 2)]
    assert yielded == [None] * WAITING_ALL_MAX + [0, 1]


def test_an_address_whose_handshakes_fail_is_refused_and_others_are_not() -> None:
    """Zenoh accepts nobody for 0.1 s after each failure."""
    failures = Failures()
    for _ in range(round(FAILURES_BURST)):
        assert not failures.refuses("attacker", 0.0)
        failures.add("attacker", 0.0)
    assert failures.refuses("attacker", 0.0)
    assert not failures.refuses("robot", 0.0)
    assert not failures.refuses("attacker", 1.0 / FAILURES_HZ), "it is let in again, rarely"


def test_who_begins_a_handshake_and_says_no_more_keeps_the_listener_from_the_next_for_a_moment(
    public: tuple[str, int], inner: socket.socket
) -> None:
    """With one listener: four such connections, and a member after them."""
    with ExitStack() as begun:
        for _ in range(4):
            begun.enter_context(_knock(public, HELLO))
        said = HELLO + b" of a member"
        with _knock(public, said):
            for _ in range(5):
                inside = begun.enter_context(inner.accept()[0])
            assert inside.recv(len(said), socket.MSG_WAITALL) == said


def test_of_those_who_wait_for_a_listener_the_address_that_failed_least_is_next() -> None:
    waiting, failures = Waiting(), Failures()
    failures.add("attacker", 0.0)
    for number, address in enumerate(("attacker", "robot", "robot")):
        waiting.add(number, address, 0.0)
    assert waiting.first(failures) == 1
    failures.add("robot", 0.0, member=True)
    assert waiting.first(failures) == 1, "the end of a member's brief connection is no failure"
    failures.succeed("attacker")
    assert waiting.first(failures) == 0


@pytest.mark.parametrize(
    ("begun", "length"),
    [
        (b"", 6),
        (HELLO[:3], 6),
        (HELLO[:5], len(HELLO)),
        (HELLO, len(HELLO)),
        (b"\x16\x02", None),
        (b"\x16\x03\x01\xff\xff", None),
        (b"\x16\x03\x01\x00\x00", None),
        (b"\x16\x03\x01\x00\x06\x02", None),
    ],
)
def test_a_client_hello_has_a_length_and_nothing_else_has(begun: bytes, length: int | None) -> None:
    assert hello_length(begun) == length


@pytest.mark.parametrize("retried", [False, True])
def test_a_handshake_is_finished_when_the_server_has_answered_the_clients_answer(retried: bool) -> None:
    """A HelloRetryRequest is answered by one hello more. Then an answer shows that it was a member."""
    shaking = Handshake()
    if retried:
        shaking.server_spoke(b"\x16\x03\x03" + RETRY)
        shaking.client_spoke(HELLO)
    shaking.server_spoke(b"certificate")
    shaking.server_spoke(b"its second half")
    assert not shaking.finished
    shaking.client_spoke(b"certificate")
    shaking.server_spoke(b"tickets")
    assert shaking.finished
    assert not shaking.member
    shaking.client_spoke(b"open")
    shaking.server_spoke(b"accepted")
    assert shaking.finished
    assert shaking.member
