"""A mission that no team could obey is refused with one line: field, value, what would be right."""

from math import cos, sin

import msgspec
import pytest

from lfa.protocol.errors import Refused
from lfa.protocol.mission import FormationSpec, Leading, Limits, Mission
from lfa.protocol.mission_checks import check_mission

GOOD = Mission(leading=Leading(route_m=((0.0, 0.0), (5.0, 0.0))))

REFUSED = [
    (msgspec.structs.replace(GOOD, robots=()), "mission.robots"),
    (msgspec.structs.replace(GOOD, robots=(1, 2, 2)), "id 2 is given twice"),
    (msgspec.structs.replace(GOOD, robots=(0, 1)), "mission.robots"),
    (msgspec.structs.replace(GOOD, can_lead=(7,)), "mission.can_lead"),
    (msgspec.structs.replace(GOOD, can_lead=()), "mission.can_lead"),
    (msgspec.structs.replace(GOOD, radius_m=-0.1), "mission.radius_m"),
    (msgspec.structs.replace(GOOD, formation=FormationSpec(separation_m=0.2)), "mission.formation.separation_m"),
    (msgspec.structs.replace(GOOD, formation=FormationSpec(angle_rad=2.0)), "mission.formation.angle_rad"),
    (msgspec.structs.replace(GOOD, limits=Limits(v_max_mps=float("nan"))), "mission.limits.v_max_mps"),
    (msgspec.structs.replace(GOOD, continue_after_s=0.1), "mission.continue_after_s"),
    (msgspec.structs.replace(GOOD, leading=Leading(route_m=())), "mission.leading.route_m"),
    (msgspec.structs.replace(GOOD, leading=Leading(route_m=((0.0, float("inf")),))), "mission.leading.route_m"),
    (msgspec.structs.replace(GOOD, leading=Leading(route_m=((0.0, 0.0),), cruise_mps=3.0)), "mission.leading.cruise"),
    (msgspec.structs.replace(GOOD, leading=Leading(route_m=((1e9, 0.0),))), "from -10000 to 10000"),
    (msgspec.structs.replace(GOOD, leading=Leading(route_m=((0.0, 0.0), (9e3, 0.0)) * 9)), "at most 10000 m"),
]

TIMED = Leading(motion="trajectory", route_m=((0.0, 0.0), (5.0, 0.0)), times_s=(0.0, 12.0))
REFUSED += [
    (msgspec.structs.replace(GOOD, leading=msgspec.structs.replace(TIMED, **wrong)), says)
    for wrong, says in (
        ({"times_s": ()}, "a time for each of the 2 way-points"),
        ({"times_s": (1.0, 12.0)}, "rising from 0"),
        ({"times_s": (0.0, float("nan"))}, "rising from 0"),
        ({"times_s": (0.0, 8.0)}, "more than cruise_mps = 0.5"),
        ({"motion": "path_following"}, "left out without"),
    )
]

BODIES = (
    (((0.1, 0.1), (-0.1, 0.1), (-0.1, -0.1)), "around the origin"),
    (((0.1, 0.1), (0.1, -0.1), (-0.1, -0.1), (-0.1, 0.1)), "counter-clockwise"),
    (((0.2, 0.1), (-0.2, 0.1), (-0.2, -0.1), (0.2, -0.1)), "mission.radius_m = 0.15: must be at least 0.2236"),
    (tuple((0.1 * cos(0.1 * n), 0.1 * sin(0.1 * n)) for n in range(62)), "62 corners: must be at most 32"),
)
REFUSED += [(msgspec.structs.replace(GOOD, footprint_m=corners), says) for corners, says in BODIES]


@pytest.mark.parametrize(("mission", "says"), REFUSED, ids=[says for _, says in REFUSED])
def test_refused_in_one_line_that_names_the_field(mission: Mission, says: str) -> None:
    with pytest.raises(Refused) as refused:
        check_mission(mission)
    assert says in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_good_mission_is_taken_as_it_is() -> None:
    assert check_mission(GOOD) is GOOD
    timed = msgspec.structs.replace(GOOD, leading=TIMED)
    assert check_mission(timed) is timed
