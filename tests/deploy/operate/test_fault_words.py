"""`lfa fault` says what an order did in words about its own target, not about faults in general."""

from __future__ import annotations

import pytest

from lfa.deploy.operate.fault import command, effect
from lfa.protocol.errors import Refused


@pytest.mark.parametrize(
    ("action", "target", "said"),
    [
        ("cut", "3", "no radio between 3 and all others, until lfa fault heal"),
        ("cut", "1,2-3,w", "no radio between 1,2 and 3,w, until lfa fault heal"),
        ("cut", "1>2", "no radio from 1 to 2, until lfa fault heal"),
        ("heal", "1-2", "the cut 1-2 is ended"),
        ("heal", "", "all cuts and all loss are ended"),
        ("loss", "0.1", "every receiver loses 10 % of its messages, until lfa fault heal"),
        ("loss", "", "every receiver loses as many messages as at the start"),
        ("range", "5", "messages reach robots up to 5 m away"),
        ("range", "0", "messages reach robots at any distance"),
    ],
)
def test_an_order_about_links_says_what_it_did(action: str, target: str, said: str) -> None:
    assert effect(action, target) == said


@pytest.mark.parametrize(
    ("words", "form"),
    [(("obstacle", "3", "1"), "must be x, y and a radius"), (("goal", "3", "1"), "must be x and y")],
)
def test_words_in_the_place_of_one_are_answered_with_its_form(words: tuple[str, ...], form: str) -> None:
    action, target, *more = words
    with pytest.raises(Refused, match=form):
        command(action, target, more)
