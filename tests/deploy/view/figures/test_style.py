"""Labels in figures."""

from __future__ import annotations

from lfa.deploy.view.figures.style import levels


def test_labels_that_would_cover_each_other_go_to_the_next_line_and_come_down_again() -> None:
    texts = [(0.0, "kill 1"), (3.0, "kill 2"), (8.0, "cut 3"), (9.0, "heal")]
    assert levels(texts, letter=1.0, most=3) == [0, 1, 0, 2]


def test_when_no_line_is_free_the_one_that_is_free_first_is_shared() -> None:
    assert levels([(0.0, "a long one"), (1.0, "short"), (2.0, "one more")], letter=1.0, most=2) == [0, 1, 1]
