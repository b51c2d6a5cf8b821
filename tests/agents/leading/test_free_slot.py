"""A follower that cannot get into its slot stands beside it, once its predecessor is at rest."""

import pytest

from lfa.agents.leading.free_slot import CIRCLED_S, LEFT_M, MOVED_M, PAUSE_S, VISITS, FreeSlot
from lfa.protocol.geometry import STILL, Pose2D, Twist

SLOT = (1.0, 0.0)
CLOSE, NEAR, FAR = Pose2D(0.9, 0.0, 0.0), Pose2D(0.8, 0.0, 0.0), Pose2D(0.6, 0.0, 0.0)


def steered(
    pose: Pose2D, until_s: float, every_s: float = 1.0, slots: FreeSlot | None = None, ahead_mps: float = 0.0
) -> Twist | None:
    """What a follower does at last that a detour has hindered each `every_s` [s], close to a free slot."""
    slots, twist = slots or FreeSlot(0.15), None
    steps = round(until_s / 0.5)
    for n in range(steps + 1):
        hindered = n % round(every_s / 0.5) == 0
        twist = slots.steer(SLOT, (), pose, ahead_mps, 0.45, 0.5 * n, hindered=hindered)
    return twist


def test_a_follower_that_detours_lead_round_its_free_slot_for_long_stands() -> None:
    assert steered(CLOSE, CIRCLED_S - 0.5) is None
    assert steered(CLOSE, CIRCLED_S) == STILL


def test_it_stands_until_its_slot_has_moved() -> None:
    slots = FreeSlot(0.15)
    steered(CLOSE, CIRCLED_S, slots=slots)
    little, far = (1.0, MOVED_M - 0.01), (1.0, MOVED_M + 0.01)
    assert slots.steer(little, (), CLOSE, 0.0, 0.45, CIRCLED_S + 1.0) == STILL
    assert slots.steer(far, (), CLOSE, 0.0, 0.45, CIRCLED_S + 2.0) is None


@pytest.mark.parametrize(
    ("pose", "every_s", "ahead_mps"),
    [
        pytest.param(NEAR, 1.0, 0.0, id="it is not yet close to the slot"),
        pytest.param(FAR, 1.0, 0.0, id="it is on its way to the slot"),
        pytest.param(CLOSE, PAUSE_S + 1.0, 0.0, id="each detour is one of its own"),
        pytest.param(CLOSE, 1.0, 0.1, id="its predecessor drives"),
    ],
)
def test_it_goes_on_while(pose: Pose2D, every_s: float, ahead_mps: float) -> None:
    assert steered(pose, 3.0 * CIRCLED_S, every_s, ahead_mps=ahead_mps) is None


def test_a_follower_that_came_from_far_circles_only_from_where_it_is_close() -> None:
    slots = FreeSlot(0.15)
    steered(FAR, CIRCLED_S, slots=slots)
    assert slots.steer(SLOT, (), CLOSE, 0.0, 0.45, CIRCLED_S + 0.5, hindered=True) is None


def visited(times: int, *, beyond_m: float = 0.7, ahead_mps: float = 0.0) -> Twist | None:
    """What a follower does at last that has come near its slot so often, and went away again between."""
    slots, twist = FreeSlot(0.15), None
    for n in range(times):
        for apart_m in (beyond_m, 0.4, 0.2):
            twist = slots.steer(SLOT, (), Pose2D(1.0 - apart_m), ahead_mps, 0.45, 10.0 * n + apart_m)
    return twist


def test_a_follower_that_comes_near_its_slot_again_and_again_stands_where_it_is_as_near_as_ever() -> None:
    """Round a block beside its slot a detour led it in a wide circle, to the run's end."""
    assert visited(VISITS) is None
    assert visited(VISITS + 1) == STILL
    assert visited(3 * VISITS, beyond_m=0.45 + LEFT_M - 0.01) is None, "it did not leave"
    assert visited(3 * VISITS, ahead_mps=0.1) is None, "its predecessor drives"
