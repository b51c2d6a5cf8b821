"""The air loses, delays and doubles as the weather says, and the same seed is the same weather."""

from random import Random

import pytest

from protocol.radio import Air, Radio


def fates(radio: Radio, count: int, seed: int = 1) -> list[list[float]]:
    air = Air(radio, Random(seed))
    return [air.delays("robot1", "robot2") for _ in range(count)]


@pytest.mark.parametrize("burst", [1.0, 5.0])
def test_the_share_of_lost_messages_is_the_given_one(burst: float) -> None:
    lost = sum(fate == [] for fate in fates(Radio(loss=0.2, loss_burst=burst), 20_000))
    assert abs(lost / 20_000 - 0.2) < 0.02


def test_bursts_have_the_given_mean_length() -> None:
    lost = [fate == [] for fate in fates(Radio(loss=0.2, loss_burst=5.0), 20_000)]
    bursts = sum(now and not before for before, now in zip([False, *lost], lost, strict=False))
    assert abs(sum(lost) / bursts - 5.0) < 0.7


def test_delays_lie_between_delay_and_delay_plus_jitter() -> None:
    delays = [delay for fate in fates(Radio(delay_s=0.01, jitter_s=0.02), 1000) for delay in fate]
    assert min(delays) >= 0.01
    assert max(delays) <= 0.03
    assert len(delays) == 1000


def test_duplication_delivers_twice() -> None:
    doubled = sum(len(fate) == 2 for fate in fates(Radio(duplication=0.3), 10_000))
    assert abs(doubled / 10_000 - 0.3) < 0.03


def test_the_same_seed_is_the_same_weather() -> None:
    radio = Radio(jitter_s=0.01, loss=0.3, loss_burst=3.0, duplication=0.1)
    assert fates(radio, 500, seed=7) == fates(radio, 500, seed=7)
    assert fates(radio, 500, seed=7) != fates(radio, 500, seed=8)
