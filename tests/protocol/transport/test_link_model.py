"""The link model loses, delays and doubles messages as its conditions say; equal seeds give equal links."""

from random import Random

import pytest
from msgspec import structs

from lfa.protocol.geometry import Pose2D, Twist
from lfa.protocol.messages.codec import Message, encode
from lfa.protocol.messages.consensus import NO_TERM, Role
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.robot import Localization
from lfa.protocol.messages.team import PoseStamped, TableRow
from lfa.protocol.transport.bus import Arrival
from lfa.protocol.transport.link_model import REORDER_S, WAITING_MAX, LinkModel, Radio, Reception, link_of


def fates(radio: Radio, count: int, seed: int = 1) -> list[list[float]]:
    model = LinkModel(radio, Random(seed))
    return [model.delays("robot1", "robot2") for _ in range(count)]


@pytest.mark.parametrize("burst", [1.0, 5.0])
def test_the_share_of_lost_messages_is_the_given_one(burst: float) -> None:
    lost = sum(fate == [] for fate in fates(Radio(loss=0.2, loss_burst=burst), 20_000))
    assert abs(lost / 20_000 - 0.2) < 0.02


def said(message: Message, key: str) -> Arrival:
    return Arrival(1.0, f"lfa/fleet/{key}", encode(message))


def test_a_live_receiver_hears_robots_up_to_the_range_by_what_they_say_of_their_place() -> None:
    reception = Reception("robot2", Random(1))
    assert reception.link_model.obey({"radio": {"range_m": 5.0}})
    header, twist = Header("robot1", 1, 1, 0.0), Twist()

    def row(x: float, placed: bool = True) -> Arrival:
        return said(TableRow(header, x, 0.0, 0.0, 0.0, 0.0, Role.LEADER, placed=placed), "robot1/table")

    def pose(x: float) -> Arrival:
        return said(PoseStamped(header, x, 0.0, 0.0, 0.0, twist, 0.0, Role.LEADER, NO_TERM), "robot1/pose")

    def heard(*arrivals: Arrival) -> list[Arrival]:
        for arrival in arrivals:
            reception.put(arrival)
        return reception.take(2.0)

    assert heard(row(9.0)) != [], "its own place is not known yet"
    own = said(Localization(header, Pose2D(0.0, 0.0, 0.0)), "robot2/localization")
    assert heard(own) == [own]
    assert heard(row(9.0)) == heard(pose(6.0)) == []
    assert heard(pose(4.0)) != []
    assert heard(row(9.0, placed=False)) != [], "a robot without a pose is where it was last"
    assert heard(Arrival(1.0, "lfa/fleet/robot1/pose", b"noise")) != [], "dropped by the decoder behind it, not here"
    assert reception.link_model.obey({"heal": True})
    assert heard(pose(9.0)) != []


def test_bursts_have_the_given_mean_length() -> None:
    lost = [fate == [] for fate in fates(Radio(loss=0.2, loss_burst=5.0), 20_000)]
    bursts = sum(now and not before for before, now in zip([False, *lost], lost, strict=False))
    assert abs(sum(lost) / bursts - 5.0) < 0.7


def test_losses_without_bursts_are_independent_of_each_other() -> None:
    lost = [fate == [] for fate in fates(Radio(loss=0.5), 20_000)]
    bursts = sum(now and not before for before, now in zip([False, *lost], lost, strict=False))
    assert abs(sum(lost) / bursts - 2.0) < 0.1


def test_a_link_begins_without_a_fade() -> None:
    first = [fates(Radio(loss=0.2, loss_burst=5.0), 1, seed=seed) == [[]] for seed in range(300)]
    assert sum(first) < 0.1 * len(first)


def test_delays_lie_between_delay_and_delay_plus_jitter() -> None:
    radio = Radio(delay_s=0.01, jitter_s=0.02)
    delays = [delay for fate in fates(radio, 1000) for delay in fate]
    assert min(delays) >= 0.01
    assert max(delays) <= radio.prompt_s == pytest.approx(0.03)
    assert len(delays) == 1000


def test_duplication_delivers_twice() -> None:
    doubled = sum(len(fate) == 2 for fate in fates(Radio(duplication=0.3), 10_000))
    assert abs(doubled / 10_000 - 0.3) < 0.03


def test_the_second_copy_comes_up_to_its_lag_later() -> None:
    both = fates(Radio(delay_s=0.01, jitter_s=0.0, duplication=1.0, duplication_lag_s=0.2), 2000)
    assert {first for first, _ in both} == {0.01}
    assert 0.19 < max(second for _, second in both) <= 0.21


def test_the_tail_holds_its_share_back_by_its_mean() -> None:
    later = [delay - 0.01 for (delay,) in fates(Radio(delay_s=0.01, jitter_s=0.0, tail=0.2, tail_mean_s=0.1), 20_000)]
    held = [delay for delay in later if delay > 0.0]
    assert abs(len(held) / 20_000 - 0.2) < 0.02
    assert abs(sum(held) / len(held) - 0.1) < 0.01


def test_a_message_held_back_is_overtaken() -> None:
    delays = [delay for (delay,) in fates(Radio(delay_s=0.01, jitter_s=0.0, reorder=0.3), 10_000)]
    assert abs(sum(delay > 0.01 for delay in delays) / 10_000 - 0.3) < 0.03
    assert 0.01 + 0.9 * REORDER_S < max(delays) <= 0.01 + REORDER_S


def test_a_condition_that_is_off_changes_no_run() -> None:
    plain = Radio(loss=0.3, loss_burst=3.0, duplication=0.1)
    assert fates(plain, 500) == fates(structs.replace(plain, tail_mean_s=9.0), 500)


def test_equal_seeds_give_equal_delays() -> None:
    radio = Radio(jitter_s=0.01, loss=0.3, loss_burst=3.0, duplication=0.1)
    assert fates(radio, 500, seed=7) == fates(radio, 500, seed=7)
    assert fates(radio, 500, seed=7) != fates(radio, 500, seed=8)


@pytest.mark.parametrize(
    ("key", "receiver", "link"),
    [
        ("lfa/f/robot1/pose", "robot2", ("robot1", "robot2")),
        ("lfa/f/robot1/lease/all", "witness", ("robot1", "world")),
        ("lfa/f/witness/lease/robot3", "robot3", ("world", "robot3")),
        ("lfa/f/world/mission", "robot3", ("world", "robot3")),
        ("lfa/f/world/mission", "witness", None),
        ("lfa/f/robot1/cmd_vel", "world", None),
        ("lfa/f/robot1/sensors", "robot1", None),
        ("lfa/f/robot2/lease/gateway1", "world", ("robot2", "robot1")),
        ("lfa/f/robot1/lease/gateway1", "world", None),
        ("lfa/f/robot1/lease/all", "robot1", None),
        ("lfa/f/operator/operator", "robot1", None),
        ("lfa/f/robot1/alive/7", "robot2", None),
        ("", "robot2", None),
    ],
)
def test_a_robot_and_its_own_hardware_do_not_speak_over_a_link(
    key: str, receiver: str, link: tuple[str, str] | None
) -> None:
    assert link_of(key, receiver) == link


def test_a_cut_is_of_one_direction_and_healing_ends_it() -> None:
    model = LinkModel(Radio(), Random(1))
    assert model.obey({"cut": [["robot1", "witness"]]})
    assert model.obey({"cut": [["robot2", "robot3"]]})
    assert model.delays("robot1", "world") == []
    assert model.delays("robot2", "robot3") == []
    assert len(model.delays("world", "robot1")) == len(model.delays("robot3", "robot2")) == 1
    assert model.obey({"heal": True})
    assert len(model.delays("robot1", "world")) == 1


@pytest.mark.parametrize(
    "order", [{"cut": [["robot1"]]}, {"radio": {"lost": 0.2}}, {"radio": {"loss": "much"}}, {"x": 1}]
)
def test_an_order_that_is_none_changes_nothing(order: dict[str, object]) -> None:
    model = LinkModel(Radio(), Random(1))
    assert not model.obey(order)
    assert (model.radio, model.cuts) == (Radio(), frozenset())


def test_what_comes_through_keeps_its_order_and_its_delay() -> None:
    reception = Reception("robot2", Random(1))
    early, late = Arrival(1.0, "lfa/f/robot1/pose", b"a"), Arrival(1.001, "lfa/f/robot2/sensors", b"b")
    assert reception.link_model.obey({"radio": {"delay_s": 0.1}})
    reception.put(early)
    reception.put(late)
    assert reception.take(1.001) == [late]
    assert reception.next_due() == pytest.approx(1.1)
    assert [(a.key, a.payload) for a in reception.take(1.2)] == [(early.key, b"a")]


def test_fair_and_heal_each_bring_the_first_conditions_back_and_only_heal_ends_cuts() -> None:
    model = LinkModel(Radio(delay_s=0.01), Random(1))
    for word, cuts_left in (("fair", 1), ("heal", 0)):
        assert model.obey({"radio": {"loss": 0.5}, "cut": [["robot1", "robot2"]]})
        assert model.obey({word: True})
        assert model.radio == Radio(delay_s=0.01)
        assert len(model.cuts) == cuts_left


def test_a_link_is_clear_without_conditions_cuts_and_messages_on_their_way() -> None:
    reception = Reception("robot2", Random(1))
    assert reception.is_clear
    reception.put(Arrival(1.0, "lfa/f/robot1/table", b""))
    assert not reception.is_clear
    reception.take(1.0)
    assert reception.is_clear
    assert reception.link_model.obey({"cut": [["robot1", "robot2"]]})
    assert not reception.is_clear
    assert reception.link_model.obey({"heal": True, "radio": {"loss": 0.1}})
    assert not reception.is_clear


def test_of_messages_due_at_one_time_the_first_comes_first() -> None:
    reception = Reception("robot2", Random(1))
    for n in range(5):
        reception.put(Arrival(1.0, "lfa/f/robot1/table", bytes([n])))
    assert [arrival.payload for arrival in reception.take(1.0)] == [bytes([n]) for n in range(5)]


def test_so_many_messages_wait_and_no_more() -> None:
    reception = Reception("robot2", Random(1))
    reception.link_model.obey({"radio": {"delay_s": 1.0, "duplication": 1.0}})
    for _ in range(WAITING_MAX):
        reception.put(Arrival(1.0, "lfa/f/robot1/table", b""))
    assert len(reception.take(3.0)) == WAITING_MAX


def test_robots_farther_apart_than_the_range_do_not_hear_each_other() -> None:
    model = LinkModel(Radio(range_m=5.0), Random(1))
    model.places = {"robot1": (0.0, 0.0), "robot2": (4.9, 0.0), "robot3": (0.0, 5.1)}
    assert [len(model.delays("robot1", other)) for other in ("robot2", "robot3", "world")] == [1, 0, 1]
    model.obey({"radio": {"range_m": 0.0}})
    assert len(model.delays("robot1", "robot3")) == 1
