"""Times of the fleet's messages on one clock."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from lfa.deploy.ros.bridge import sender_clocks
from lfa.deploy.ros.bridge.sender_clocks import NS, SenderClocks
from lfa.protocol.messages.header import Header

WALL_NS = 1_700_000_000 * NS


def header(stamp: float, sender: str = "robot1") -> Header:
    return Header(sender, 1, 1, stamp)


@given(st.lists(st.floats(0.0, 0.5), min_size=1, max_size=40), st.floats(-1e6, 1e6))
def test_a_stamp_becomes_the_time_of_sending_by_the_least_delay_seen(delays: list[float], zero: float) -> None:
    """Whatever the sender's clock counts from; the error is the least delay so far."""
    clocks = SenderClocks(WALL_NS, sim_time=False)
    for n, delay in enumerate(delays):
        sent = 100.0 + n
        error_s = (clocks.stamp_ns(header(sent - zero), sent + delay) - WALL_NS) / NS - sent
        assert abs(error_s - min(delays[: n + 1])) < 1e-3


@given(st.lists(st.floats(0.0, 0.1), min_size=1, max_size=200))
def test_messages_that_waited_for_the_loop_do_not_blur_a_senders_clock(waits: list[float]) -> None:
    clocks = SenderClocks(WALL_NS, sim_time=False)
    clocks.stamp_ns(header(0.0), 1.0)  # arrived at once
    for n, wait in enumerate(waits):
        sent = 1.0 + 0.02 * n
        error_s = (clocks.stamp_ns(header(sent - 1.0), sent + wait, prompt=False) - WALL_NS) / NS - sent
        assert abs(error_s) < 1e-6


@given(st.lists(st.floats(-1e12, 1e12), min_size=1, max_size=5))
def test_a_clock_that_jumps_dates_nothing_more_than_a_minute_back(stamps: list[float]) -> None:
    clocks = SenderClocks(WALL_NS, sim_time=False)
    for stamp in stamps:
        assert 0 <= WALL_NS + 100 * NS - clocks.stamp_ns(header(stamp), 100.0) <= sender_clocks.AGE_S_MAX * NS


def test_no_message_is_stamped_after_its_arrival() -> None:
    clocks = SenderClocks(WALL_NS, sim_time=False)
    clocks.stamp_ns(header(0.0), 10.0)
    assert clocks.stamp_ns(header(5.0), 12.0) <= WALL_NS + 12 * NS


def test_with_sim_time_stamps_are_the_worlds_and_wait_for_it() -> None:
    clocks = SenderClocks(WALL_NS, sim_time=True)
    assert not clocks.ready
    clocks.see_world(50.0, 3.0)
    assert clocks.ready
    assert clocks.stamp_ns(header(50.5), 50.5) == round(3.5 * NS)


def test_the_number_of_senders_is_bounded() -> None:
    clocks = SenderClocks(WALL_NS, sim_time=False)
    for n in range(3 * sender_clocks.SENDERS_MAX):
        clocks.stamp_ns(header(0.0, f"robot{n}"), 1.0)
    assert len(clocks._senders) <= sender_clocks.SENDERS_MAX
