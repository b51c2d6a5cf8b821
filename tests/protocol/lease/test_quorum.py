"""Which sets of voters decide."""

from itertools import combinations
from random import Random

import pytest

from lfa.protocol.lease.quorum import electors, is_half, is_quorum, quorum_time
from lfa.protocol.messages.consensus import NO_TERM, Config, Electorate, Member, Version


def members(*ids: int) -> tuple[Member, ...]:
    return tuple(Member(i, 1) for i in ids)


W = Member(0, 1)
RULES = ("half", "all")


@pytest.mark.parametrize(
    ("voters", "tie", "present", "decides"),
    [
        ((1, 2, 3), None, (1, 2), True),
        ((1, 2, 3), None, (1,), False),
        ((1, 2, 3, 4), None, (1, 2), False),
        ((0, 1, 2, 3), W, (0, 1), True),
        ((0, 1, 2, 3), W, (1, 2), False),
        ((0, 1), W, (0,), True),
        ((0, 1), W, (1,), False),
        ((1,), None, (1,), True),
        ((0, 1, 2, 3, 4), W, (0, 1), False),
        ((0, 1, 2, 3, 4), W, (1, 2, 3), True),
        ((1, 2, 3), None, (1, 7, 8), False),
    ],
)
def test_a_majority_or_one_half_with_the_tie_breaker_decides(
    voters: tuple[int, ...], tie: Member | None, present: tuple[int, ...], decides: bool
) -> None:
    assert is_half(members(*voters), tie, members(*present)) is decides


@pytest.mark.parametrize("size", range(1, 6))
def test_two_quorums_of_one_electorate_share_a_voter(size: int) -> None:
    voters = members(*range(size))
    quorums = [
        set(some) for k in range(size + 1) for some in combinations(voters, k) if is_half(voters, voters[0], some)
    ]
    assert all(one & other for one in quorums for other in quorums)


def joint(voters: tuple[Member, ...], previous: Electorate | None) -> Config:
    return Config(Version(NO_TERM, 0), voters, None, previous, voters)


def test_a_joint_config_needs_both_electorates() -> None:
    config = joint(members(1, 2), Electorate(members(1, 2, 3, 4)))
    assert not is_quorum(config, members(1, 2))
    assert not is_quorum(config, members(1, 3, 4))
    assert is_quorum(config, members(1, 2, 3))


def test_after_a_full_house_every_named_life_must_agree() -> None:
    config = joint(members(1, 2, 3), Electorate(members(1, 2, 3), None, "all"))
    assert not is_quorum(config, members(1, 2))
    assert is_quorum(config, members(1, 2, 3))


def test_another_life_of_a_voter_is_not_that_voter() -> None:
    assert not is_half(members(1, 2, 3), None, (Member(1, 2), Member(2, 1)))


def test_the_quorum_time_is_the_newest_that_a_quorum_has_reached() -> None:
    config = joint(members(1, 2, 3), None)
    times = dict(zip(members(1, 2, 3, 9), (1.0, 5.0, 3.0, 9.0), strict=True))
    assert quorum_time(config, times) == 3.0
    assert quorum_time(config, {members(1)[0]: 1.0}) is None


def test_the_quorum_time_is_what_the_quorums_say() -> None:
    """For every pair of small electorates and every order of times: the latest t whose members make a quorum."""
    random = Random(7)
    for _ in range(3000):
        ids = members(0, 1, 2, 3, 4)
        voters = tuple(random.sample(ids, random.randint(0, 5)))
        tie = random.choice((None, *voters))
        before = tuple(random.sample(ids, random.randint(1, 5)))
        previous = random.choice((None, Electorate(before, random.choice((None, *before)), random.choice(RULES))))
        config = Config(Version(NO_TERM, 0), voters, tie, previous, voters)
        times = {m: float(random.randint(0, 3)) for m in ids if random.random() < 0.8}
        reached = [t for t in times.values() if is_quorum(config, {m for m, at in times.items() if at >= t})]
        assert quorum_time(config, times) == max(reached, default=None), (config, times)


def test_the_electors_of_a_joint_config_are_both_sets_each_once() -> None:
    config = joint(members(3, 1), Electorate(members(1, 2)))
    assert electors(config) == members(3, 1, 2)
