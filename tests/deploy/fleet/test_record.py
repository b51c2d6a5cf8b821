"""What `lfa record` says of the fleet that it followed."""

from __future__ import annotations

import pytest
from msgspec import structs

from lfa.deploy.fleet.record import _name
from lfa.world.description.load import shipped


@pytest.mark.parametrize(("file", "named"), [("straight", "straight"), ("scenario", "convoy")])
def test_a_recorded_run_is_named_by_its_scenario_or_where_a_run_folder_has_that_by_its_fleet(
    file: str, named: str
) -> None:
    assert _name(structs.replace(shipped()["straight"], name=file), "convoy") == named
