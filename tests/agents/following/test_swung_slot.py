"""A follower that cannot get to its slot while its predecessor rests follows at another angle."""

from __future__ import annotations

from math import cos, hypot, pi, sin

import pytest

from lfa.agents.following.swung_slot import CLEAR_M, OUT_S, STEP_RAD, SwungSlot
from lfa.protocol.geometry import Pose2D, in_base
from lfa.protocol.messages.team import Slot

RADIUS_M, WITHIN_M = 0.15, 0.45
SLOT, PLACE, AHEAD = Slot(2, 1.0, pi), (0.0, 0.0), Pose2D(1.0, 0.0, 0.0)
POSE = Pose2D(0.0, 1.0, 0.0)
"""The slot behind a predecessor at x = 1 m, and a robot beside it."""


def place_of(slot: Slot) -> tuple[float, float]:
    return AHEAD.x + slot.separation_m * cos(slot.phi), AHEAD.y + slot.separation_m * sin(slot.phi)


class Follower:
    """Follower that stands, and sees posts at places in `map`."""

    def __init__(self, *posts: tuple[float, float], pose: Pose2D = POSE) -> None:
        self.slots, self.pose, self.slot = SwungSlot(RADIUS_M), pose, SLOT
        self.points = [in_base(pose, post) for post in posts]

    def until(self, now: float, ahead_mps: float = 0.0) -> Slot:
        """The slot after it was looked at until then."""
        for at in (now - 0.02, now):
            self.slot = self.slots.swung(
                SLOT, place_of(self.slot), AHEAD, 0.0, ahead_mps, self.points, self.pose, WITHIN_M, at
            )
        return self.slot


def test_the_slot_swings_to_the_nearest_free_place_once_the_robot_is_out_of_it_for_long() -> None:
    follower = Follower((0.0, 0.1))
    assert follower.until(1.0) == SLOT
    assert follower.until(OUT_S + 0.5) == SLOT
    assert not follower.slots.is_swung
    swung = follower.until(OUT_S + 1.5)
    assert follower.slots.is_swung and swung.separation_m == SLOT.separation_m
    x, y = place_of(swung)
    assert hypot(x, y - 0.1) >= RADIUS_M + CLEAR_M
    assert abs(swung.phi) == pytest.approx(pi - STEP_RAD * 1, abs=STEP_RAD + 1e-9)


def test_it_is_the_slot_that_was_asked_for_again_as_soon_as_the_predecessor_drives() -> None:
    follower = Follower((0.0, 0.1))
    follower.until(1.0)
    assert follower.until(OUT_S + 2.0) != SLOT
    assert follower.until(OUT_S + 3.0, ahead_mps=0.1) == SLOT
    assert not follower.slots.is_swung


def test_it_is_the_slot_that_is_asked_for_as_soon_as_that_is_another_one() -> None:
    follower = Follower((0.0, 0.1))
    follower.until(1.0)
    assert follower.until(OUT_S + 2.0) != SLOT
    other = Slot(2, 1.2, 0.75 * pi)
    assert follower.slots.swung(other, PLACE, AHEAD, 0.0, 0.0, [], POSE, WITHIN_M, OUT_S + 3.0) == other
    assert not follower.slots.is_swung


def test_a_place_to_which_it_cannot_get_either_is_not_tried_again() -> None:
    follower = Follower((0.0, 0.1))
    follower.until(1.0)
    first, second = follower.until(OUT_S + 2.0), follower.until(2.0 * OUT_S + 4.0)
    assert first != second and SLOT not in (first, second)


def test_a_place_that_the_scan_does_not_show_is_not_chosen() -> None:
    wall = [(0.02 * n, 0.5) for n in range(-100, 101)]
    follower = Follower(*wall)
    follower.until(1.0)
    _, y = place_of(follower.until(OUT_S + 2.0))
    assert y > 0.5


def test_a_robot_in_its_slot_or_still_far_from_it_keeps_it() -> None:
    for pose in (Pose2D(0.0, 0.9 * WITHIN_M, 0.0), Pose2D(-4.0, 0.0, 0.0)):
        follower = Follower((0.0, 0.1), pose=pose)
        follower.until(1.0)
        assert follower.until(3.0 * OUT_S) == SLOT
