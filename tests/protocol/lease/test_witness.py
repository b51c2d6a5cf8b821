"""The witness as a Node."""

from lfa.protocol.messages.consensus import Hello, LeaseNote, Prepare, Promise, Term, Version
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.team import Ask, MissionNote, Status
from lfa.protocol.mission import Leading, Mission
from lfa.protocol.node import Received, Stop
from lfa.protocol.witness import Witness

MISSION = Mission(robots=(1, 2), leading=Leading(route_m=((1.0, 0.0),)))


def test_without_a_mission_it_asks_for_one_twice_a_second() -> None:
    witness = Witness("f", 1, 0)
    asked = [t / 10 for t in range(20) if any(isinstance(e.message, Ask) for e in witness.tick(t / 10))]
    assert asked == [0.0, 0.5, 1.0, 1.5]


def test_with_a_mission_it_votes_once_its_earlier_lifes_bonds_have_run_out() -> None:
    witness = Witness("f", 1, 0)
    witness.tick(0.0)
    witness.receive(Received(0.1, "lfa/f/operator/mission", MissionNote(Header("operator", 1, 0, 0.0), MISSION)))
    assert witness.lease is not None
    ask = LeaseNote(Header("robot1", 7, 0, 0.0), Prepare(Term(5, 1, 7), Version(), agreed=witness.lease.agreed))
    assert witness.receive(Received(0.2, "lfa/f/robot1/lease/all", ask)) == []
    [answer] = witness.receive(Received(0.5, "lfa/f/robot1/lease/all", ask))
    assert answer.key == "lfa/f/witness/lease/robot1"
    assert isinstance(answer.message, LeaseNote)
    assert isinstance(answer.message.body, Promise)


def test_it_tells_its_state_once_a_second_and_never_leads() -> None:
    witness = Witness("f", 1, 0, MISSION)
    told, now = [], 0.0
    while now < 5.0:
        told += [e.message for e in witness.tick(now)]
        now = max(witness.next_deadline(), now + 1e-6)
    assert sum(isinstance(m, Status) for m in told) == 5
    assert not any(isinstance(m, LeaseNote) and isinstance(m.body, Prepare) for m in told)


def test_it_names_those_that_the_first_election_waits_for() -> None:
    witness = Witness("f", 1, 0, MISSION)
    witness.tick(0.0)
    assert witness.lease is not None
    hello = LeaseNote(Header("robot1", 7, 0, 0.0), Hello(None, witness.lease.agreed))
    witness.receive(Received(0.1, "lfa/f/robot1/lease/all", hello))
    [status] = [e.message for e in witness.tick(1.0) if isinstance(e.message, Status)]
    assert status.text == "waiting for robot2"


def test_on_stop_it_finishes() -> None:
    witness = Witness("f", 1, 0, MISSION)
    witness.tick(0.0)
    witness.receive(Received(0.1, "", Stop()))
    assert witness.finished


def test_lease_notes_of_strangers_are_ignored() -> None:
    witness = Witness("f", 1, 0, MISSION)
    witness.tick(0.0)
    note = LeaseNote(Header("gremlin", 7, 0, 0.0), Hello(None))
    assert witness.receive(Received(0.5, "lfa/f/gremlin/lease/all", note)) == []
