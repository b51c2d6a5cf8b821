"""The grammar of faults, and when each is due."""

from __future__ import annotations

import pytest

from lfa.deploy.faults.link_faults import links
from lfa.deploy.faults.script import Fault, FaultSchedule, parse, parse_all
from lfa.protocol.errors import Refused
from lfa.protocol.mission import Mission

MISSION = Mission()


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("kill leader at 20 s", Fault("kill", "leader", 20.0)),
        ("kill leader at 20s", Fault("kill", "leader", 20.0)),
        (" terminate  3 at 9.5 s ", Fault("terminate", 3, 9.5)),
        ("stop robot2 at 5 s for 3 s", Fault("stop", 2, 5.0, 3.0)),
        ("restart 2 at 12 s", Fault("restart", 2, 12.0)),
        ("cut 3 at 5 s for 4 s", Fault("cut", 3, 5.0, 4.0)),
        ("cut leader at 5 s", Fault("cut", "leader", 5.0)),
        ("cut 1,2-3,4,w at 5 s", Fault("cut", "1,2-3,4,w", 5.0)),
        ("cut 1>2 at 5 s", Fault("cut", "1>2", 5.0)),
        ("heal at 9 s", Fault("heal", "", 9.0)),
        ("heal 1>2 at 9 s", Fault("heal", "1>2", 9.0)),
        ("loss 0.2 at 5 s for 3 s", Fault("loss", "0.2", 5.0, 3.0)),
        ("loss at 5 s", Fault("loss", "", 5.0)),
        ("handover at 5 s", Fault("handover", "leader", 5.0)),
        ("hang driver 2 at 9 s", Fault("hang", "driver 2", 9.0)),
        ("hang localization  3 at 9 s for 2 s", Fault("hang", "localization 3", 9.0, 2.0)),
        ("resume scanner 1 at 9 s", Fault("resume", "scanner 1", 9.0)),
        ("formation column at 9 s", Fault("formation", "column", 9.0)),
        ("obstacle -5,1.5,0.3 at 12345.67 s", Fault("obstacle", "-5,1.5,0.3", 12345.67)),
        ("goal 3,-1.5 at 9 s", Fault("goal", "3,-1.5", 9.0)),
        ("goal 3 -1.5 at 9 s", Fault("goal", "3,-1.5", 9.0)),
        ("range 2.5 at 0.01 s", Fault("range", "2.5", 0.01)),
    ],
)
def test_a_sentence_is_a_fault(text: str, fault: Fault) -> None:
    assert parse(text, MISSION) == fault
    assert parse(str(fault), MISSION) == fault


@pytest.mark.parametrize(
    "text",
    [
        "", "kill", "kill leader", "kill leader at noon", "kill leader at -1 s", "kill leader at 20", "kill 5 at 1 s",
        "kill 0 at 1 s", "hug leader at 20 s", "kill 2 at 1 s for 3 s", "restart leader at 2 s",
        "cut at 1 s", "cut 5 at 1 s", "cut 1,2-2 at 1 s", "cut 1>w>2 at 1 s", "loss 2 at 1 s", "loss some at 1 s",
        "formation at 1 s", "formation up at 1 s", "range at 1 s", "range -1 at 1 s", "range far at 1 s",
        "obstacle 1,2 at 1 s", "obstacle 1,2,0.01 at 1 s", "obstacle 1,2,9 at 1 s", "obstacle 99999,0,1 at 1 s",
        "obstacle 1,2,3,4 at 1 s", "formation column at 1 s for 2 s",
        "goal at 1 s", "goal 1 at 1 s", "goal 1,2,3 at 1 s", "goal 1 2 3 at 1 s", "goal nan,1 at 1 s",
        "goal 99999,0 at 1 s", "goal leader at 1 s", "goal 1,2 at 1 s for 2 s",
        "handover 2 at 1 s", "heal at 1 s for 2 s", "cut leader-2 at 1 s", "kill 1,2 at 1 s", "kill at 1 s",
        "kill leader at 1 s or so", "kill \u0662 at 1 s", "kill leader at 1e3 s", f"kill {'9' * 5000} at 1 s",
        f"kill leader at {'9' * 400} s", f"cut {'9' * 5000} at 1 s",
    ],
)  # fmt: skip
def test_what_is_no_fault_is_refused_in_one_line(text: str) -> None:
    with pytest.raises(Refused) as refused:
        parse(text, MISSION)
    assert "\n" not in str(refused.value)
    assert str(refused.value).startswith("--fault")


def test_a_scenarios_fault_is_refused_as_the_scenarios() -> None:
    with pytest.raises(Refused, match=r"^scenario\.faults"):
        parse_all(MISSION, ["kill 7 at 1 s"], [])


def test_faults_come_in_the_order_of_their_times() -> None:
    schedule = FaultSchedule(parse_all(MISSION, ["kill 3 at 9 s"], ["kill 2 at 4 s"]))
    assert schedule.due(3.9, None) == []
    assert schedule.due(10.0, None) == [("kill", 2), ("kill", 3)]
    assert schedule.pending == []


def test_a_fault_on_the_leader_waits_for_one() -> None:
    schedule = FaultSchedule([parse("kill leader at 1 s", MISSION)])
    assert schedule.due(2.0, None) == []
    assert schedule.due(2.5, 4) == [("kill", 4)]


def test_who_is_stopped_for_a_while_is_woken_even_if_another_leads_by_then() -> None:
    schedule = FaultSchedule([parse("stop leader at 1 s for 2 s", MISSION)])
    assert schedule.due(1.0, 1) == [("stop", 1)]
    assert schedule.due(2.9, 2) == []
    assert schedule.due(3.0, 2) == [("continue", 1)]


def test_a_fault_added_on_the_way_has_the_place_that_it_has_in_a_schedule_written_beforehand() -> None:
    first, added = parse("stop 2 at 1 s for 2 s", MISSION), parse("kill 2 at 3 s", MISSION)
    beforehand, on_the_way = FaultSchedule([first, added]), FaultSchedule([first])
    assert beforehand.due(1.0, 1) == on_the_way.due(1.0, 1) == [("stop", 2)]
    on_the_way.add(added)
    assert beforehand.due(3.0, 1) == on_the_way.due(3.0, 1) == [("kill", 2), ("continue", 2)]


def test_a_cut_for_a_while_heals_only_itself() -> None:
    schedule = FaultSchedule([parse("cut leader at 1 s for 2 s", MISSION), parse("loss 0.1 at 1 s for 1 s", MISSION)])
    assert schedule.due(1.0, 1) == [("cut", 1), ("loss", "0.1")]
    assert schedule.due(3.0, 2) == [("loss", ""), ("heal", 1)]


@pytest.mark.parametrize(
    ("text", "parted"),
    [
        ("1>2", {("robot1", "robot2")}),
        ("1-2", {("robot1", "robot2"), ("robot2", "robot1")}),
        ("2-w", {("robot2", "world"), ("world", "robot2")}),
        ("1,2", {(a, b) for one in ("robot1", "robot2") for other in ("robot3", "world")
                 for a, b in ((one, other), (other, one))}),
    ],
)  # fmt: skip
def test_a_cut_parts_sides_one_way_or_both(text: str, parted: set[tuple[str, str]]) -> None:
    assert set(links(text, (1, 2, 3))) == parted
