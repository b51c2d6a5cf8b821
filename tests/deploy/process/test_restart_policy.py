"""When a supervisor starts again what has ended."""

from __future__ import annotations

import pytest

from lfa.deploy.process.restart_policy import ROUTER, Policy, Restart, RestartBackoff


@pytest.mark.parametrize(
    ("policy", "code", "word"),
    [
        ("never", 1, "failed"),
        ("never", 0, "ended"),
        ("never", -9, "failed"),
        ("on-failure", 0, "ended"),
        ("on-failure", 1, "waiting"),
        ("on-failure", -9, "waiting"),
        ("on-failure", 2, "refused"),
        ("always", 0, "waiting"),
        ("always", 2, "refused"),
    ],
)
def test_the_policy_says_which_ends_are_for_good(policy: Policy, code: int, word: str) -> None:
    verdict = RestartBackoff(Restart(policy)).ended(code, 100.0)
    assert verdict.word == word
    assert (verdict.at is not None) == (word == "waiting")


def test_the_delay_doubles_up_to_its_bound() -> None:
    lives = RestartBackoff(Restart(delay_s=0.5, delay_max_s=3.0, starts_max=10))
    delays = [lives.ended(1, 10.0 + n).at for n in range(5)]
    assert [at - 10.0 - n for n, at in enumerate(delays) if at is not None] == [0.5, 1.0, 2.0, 3.0, 3.0]


def test_who_fails_too_often_within_the_window_is_given_up() -> None:
    lives = RestartBackoff(Restart(window_s=60.0, starts_max=3))
    assert [lives.ended(1, float(n)).word for n in range(4)] == ["waiting"] * 3 + ["failed"]


def test_what_is_older_than_the_window_counts_no_more() -> None:
    lives = RestartBackoff(Restart(delay_s=0.5, window_s=60.0, starts_max=3))
    for n in range(3):
        lives.ended(1, float(n))
    later = lives.ended(1, 100.0)
    assert later.at == 100.5


def test_an_operators_start_is_a_new_beginning() -> None:
    lives = RestartBackoff(Restart(starts_max=1))
    lives.ended(1, 0.0)
    lives.forget()
    assert lives.ended(1, 1.0).word == "waiting"


def test_a_router_is_never_given_up() -> None:
    lives = RestartBackoff(ROUTER)
    assert {lives.ended(-9, float(n) / 10.0).word for n in range(500)} == {"waiting"}
