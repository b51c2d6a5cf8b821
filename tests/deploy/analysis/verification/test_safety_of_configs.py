"""The checkers of configs and rosters notice each breach of I5, I6 and I11, and nothing beside it."""

from __future__ import annotations

from lfa.deploy.analysis.verification.safety import (
    JointChange,
    OneChain,
    RosterHolds,
)
from lfa.protocol.messages.consensus import (
    Config,
    Electorate,
    Member,
    Roster,
    Spare,
)
from tests.rigs.lease_facts import FOUR, LOW, NEW, OLD, ONE, STD, TEAM, THREE, TWO, config, found, grant

# I5


def test_i5_a_version_is_one_config_and_grows() -> None:
    checker = OneChain(STD)
    checker.adopts(0.0, ONE, config())
    checker.adopts(0.0, TWO, config())
    checker.adopts(0.0, ONE, config(seq=1))
    assert found(checker) == 0
    checker.adopts(0.0, ONE, config(seq=1))
    assert found(checker) == 1
    checker.adopts(0.0, THREE, config(seq=1, chain=(TWO,)))
    assert found(checker) == 2
    checker.adopts(0.0, ONE, config())
    assert found(checker) == 3


def test_i5_who_leads_is_first_in_the_chain_that_it_knows() -> None:
    checker = OneChain(STD)
    checker.leads(0.0, ONE, LOW, 1.0)
    assert found(checker) == 1
    checker.adopts(0.0, ONE, config())
    checker.leads(0.0, ONE, LOW, 1.0)
    assert found(checker) == 1
    checker.adopts(0.0, ONE, config(seq=1, chain=(TWO, ONE)))
    checker.leads(0.0, ONE, LOW, 1.0)
    assert found(checker) == 2
    checker.adopts(0.0, ONE, config(seq=2, chain=()))
    checker.leads(0.0, ONE, LOW, 1.0)
    assert found(checker) == 3


# I6


def changed(*configs: Config, accepted: tuple[tuple[Member, int], ...] = ()) -> JointChange:
    checker = JointChange(STD)
    checker.adopts(0.0, ONE, config())
    for conf in configs:
        checker.adopts(0.0, ONE, conf)
        for who, seq in accepted if conf.previous is not None else ():
            checker.grants(0.0, who, grant(LOW, seq), 1.0)
    return checker


BY_BOTH = ((ONE, 1), (TWO, 1), (THREE, 1))


def test_i6_voters_change_by_a_joint_config_that_both_sets_accept() -> None:
    joint, end = config(seq=1, voters=NEW, previous=OLD), config(seq=2, voters=NEW)
    assert found(changed(joint, end, accepted=BY_BOTH)) == 0
    assert found(changed(joint, joint, end, end, accepted=BY_BOTH)) == 0
    assert found(changed(joint, end, accepted=((ONE, 1), (FOUR, 1)))) == 1
    assert found(changed(joint, end, accepted=((ONE, 1), (TWO, 1), (THREE, 0)))) == 1
    assert found(changed(joint, end, accepted=(*BY_BOTH, (THREE, 0)))) == 0  # an older grant takes nothing back


def test_i6_other_voters_need_a_joint_config_that_names_those_before() -> None:
    assert found(changed(config(seq=1, voters=NEW))) == 1
    assert found(changed(config(seq=1, tie=ONE))) == 1
    assert found(changed(config(seq=1, voters=NEW, previous=Electorate(TEAM, ONE)))) == 1
    joint = config(seq=1, voters=NEW, previous=OLD)
    assert found(changed(joint, config(seq=2, voters=TEAM, previous=Electorate(NEW)), accepted=BY_BOTH)) == 1
    assert found(changed(config(seq=1, previous=OLD))) == 1  # joint with the same voters


def test_i6_only_neighbours_are_compared_and_the_same_voters_go_on() -> None:
    assert found(changed(config(seq=2, voters=NEW))) == 0
    assert found(changed(config(seq=1, chain=(ONE,)))) == 0


# I11


def test_i11_a_retired_robot_is_in_no_chain() -> None:
    for chain, broken in ((TEAM, 1), ((ONE, THREE), 0)):
        checker = RosterHolds(STD)
        checker.adopts(0.0, ONE, config(chain=chain, roster=Roster((), (2,))))
        assert found(checker) == broken


def test_i11_spares_are_fewer_than_the_other_voters() -> None:
    for voters, broken in ((TEAM, 0), ((ONE, THREE), 1), ((ONE, TWO), 0), ((THREE,), 1)):
        checker = RosterHolds(STD)
        checker.adopts(0.0, ONE, config(voters=voters, roster=Roster((Spare(3),))))
        assert found(checker) == broken
    checker = RosterHolds(STD)
    checker.adopts(0.0, ONE, config(voters=NEW, roster=Roster((Spare(3), Spare(4)))))
    assert found(checker) == 1
