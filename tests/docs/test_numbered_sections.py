"""The site's sections for numbered rules and words: one for each row, and other tables stay."""

from __future__ import annotations

from tests.docs.numbered_sections import on_page_markdown

RULES = "| rule | text | where |\n| --- | --- | --- |\n| E1 | It is new. | `a.py` |\n| E2 | It lasts. | - |\n"


def test_each_rule_of_a_table_has_a_section_under_its_number() -> None:
    made = on_page_markdown(f"## Rules\n\n{RULES}\nMore.\n").split("\n#### ")
    assert [part.split() for part in made[1:]] == [
        ["E1", "It", "is", "new.", "*where:", "`a.py`*"],
        ["E2", "It", "lasts.", "---", "More."],
    ]


def test_the_head_of_a_table_without_a_name_for_its_numbers_stands_before_them() -> None:
    made = on_page_markdown("| | holds at every moment |\n| --- | --- |\n| I1 | One acts. |\n")
    assert made.split("\n#### ")[0].split() == ["Holds", "at", "every", "moment:"]


def test_each_word_of_the_glossary_has_a_section() -> None:
    assert "#### term\n\nEpoch.\n" in on_page_markdown("| word | meaning |\n| --- | --- |\n| term | Epoch. |\n")


def test_a_table_of_other_things_stays() -> None:
    table = RULES.replace("| E2 |", "| rule E2 |")
    assert on_page_markdown(table) == table
