"""One secured fleet for the attacks of a module; after each of them it must still drive."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.rigs.secured_fleet import Attacked, attacked


@pytest.fixture(scope="module")
def shared() -> Iterator[Attacked]:
    with attacked() as made:
        yield made


@pytest.fixture
def fleet(shared: Attacked) -> Iterator[Attacked]:
    yield shared
    shared.drives_on()
