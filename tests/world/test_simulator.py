"""Virtual time: order, clocks, silence of the dead, and patience of the stopped."""

from __future__ import annotations

import pytest

from lfa.protocol.geometry import Twist
from lfa.protocol.messages.codec import Message, encode
from lfa.protocol.messages.consensus import Role, Term
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.team import Ask, PoseStamped
from lfa.protocol.node import Envelope, PeerDown, PeerUp, Received, Stop, Vitals
from lfa.protocol.runtime.journal import JOURNAL_VERSION, Heading, Journal
from lfa.protocol.topics import alive_key, key
from lfa.protocol.transport.link_model import Radio
from lfa.world.simulator import HINT_DELAY_S, Simulator
from lfa.world.virtual_time import LocalClock


class Talker:
    """Says its pose every 100 ms of its own clock and remembers what it hears."""

    incarnation = 1
    refusal = None

    def __init__(self, name: str) -> None:
        self.name = name
        self.heard: list[tuple[float, object]] = []
        self.ticks: list[float] = []
        self.finished = False
        self._next = 0.0
        self.interests = frozenset({key("f", "*", "pose"), key("f", "*", "ask"), alive_key("f", "*", "*")})

    def next_deadline(self) -> float:
        return self._next

    def tick(self, now: float) -> list[Envelope]:
        self.ticks.append(now)
        self._next += 0.1
        return [self._pose(now)]

    def receive(self, received: Received) -> list[Envelope]:
        if not isinstance(received.message, Vitals):
            self.heard.append((received.at, received.message))
        self.finished = isinstance(received.message, Stop)
        return []

    def poses(self) -> list[tuple[float, PoseStamped]]:
        return [(at, said) for at, said in self.heard if isinstance(said, PoseStamped)]

    def _pose(self, now: float) -> Envelope:
        header = Header(self.name, 1, len(self.ticks), now)
        pose = PoseStamped(header, 0.0, 0.0, 0.0, 0.0, Twist(), 0.0, Role.FOLLOWER, Term())
        return Envelope(key("f", self.name, "pose"), pose)


def pair(radio: Radio | None = None, clock: LocalClock | None = None) -> tuple[Simulator, Talker, Talker]:
    simulator = Simulator(radio or Radio(0.001, 0.0), seed=1)
    a, b = Talker("robot1"), Talker("robot2")
    for node, its_clock in ((a, None), (b, clock)):
        simulator.add(node, Journal(None, Heading(JOURNAL_VERSION, node.name, 1, 0, {})), its_clock)
    return simulator, a, b


def test_a_message_arrives_after_the_radio_delay_by_the_receivers_clock() -> None:
    simulator, _, b = pair(clock=LocalClock(offset_s=100.0))
    simulator.run(0.05)
    [(at, said), *_] = [entry for entry in b.poses() if entry[1].header.sender == "robot1"]
    assert said.header.stamp == 0.0
    assert at == pytest.approx(100.001)


def test_a_node_ticks_by_its_own_clock() -> None:
    simulator, a, b = pair(clock=LocalClock(rate=2.0))
    simulator.run(1.005)
    assert len(a.ticks) == 11
    assert len(b.ticks) == 21


class Counted(Talker):
    """Talker that counts how often it is asked for its next deadline, and answers the poses of robot 1."""

    asked = 0

    def next_deadline(self) -> float:
        self.asked += 1
        return super().next_deadline()

    def receive(self, received: Received) -> list[Envelope]:
        super().receive(received)
        said = received.message
        return [self._pose(received.at)] if isinstance(said, PoseStamped) and said.header.sender == "robot1" else []


@pytest.mark.parametrize(("topic", "more"), [("pose", 0), ("ask", 1)])
def test_a_deadline_is_asked_for_anew_by_a_message_that_wakes_and_by_no_other(topic: str, more: int) -> None:
    simulator = Simulator(Radio(0.001, 0.0), seed=1)
    node = Counted("robot3")
    simulator.add(node, Journal(None, Heading(JOURNAL_VERSION, node.name, 1, 0, {})))
    simulator.run(0.25)
    before, header = node.asked, Header("robot2", 1, 0, 0.25)
    pose = PoseStamped(header, 0.0, 0.0, 0.0, 0.0, Twist(), 0.0, Role.FOLLOWER, Term())
    simulator.publish(key("f", "robot2", topic), encode(pose if topic == "pose" else Ask(header, "mission")))
    simulator.run(0.26)
    assert [said for _, said in node.heard][-1].header == header
    assert node.asked == before + more


def test_what_a_node_answers_to_a_message_that_wakes_nobody_is_sent_at_once() -> None:
    simulator, _, b = pair()
    node = Counted("robot3")
    simulator.add(node, Journal(None, Heading(JOURNAL_VERSION, node.name, 1, 0, {})))
    simulator.run(0.15)
    answers = [at for at, said in b.poses() if said.header.sender == "robot3" and said.header.stamp not in node.ticks]
    assert answers[-1] == pytest.approx(0.102, abs=1e-4)


def test_a_killed_node_is_silent_and_the_others_are_told_within_milliseconds() -> None:
    simulator, a, b = pair()
    simulator.run(1.05)
    simulator.kill("robot1")
    simulator.run(2.0)
    downs = [at for at, said in b.heard if said == PeerDown("robot1", 1)]
    assert len(downs) == 1
    assert HINT_DELAY_S[0] <= downs[0] - 1.05 <= HINT_DELAY_S[1]
    assert max(said.header.stamp for _, said in b.poses() if said.header.sender == "robot1") <= 1.05
    assert max(a.ticks) <= 1.05


def test_a_stopped_node_gets_all_that_waited_but_only_the_newest_of_a_state() -> None:
    simulator, _, b = pair()
    simulator.run(1.05)
    simulator.pause("robot2")
    before = len(b.poses())
    simulator.run(2.05)
    assert len(b.poses()) == before
    simulator.resume("robot2")
    late = b.poses()[before:]
    assert [round(said.header.stamp, 3) for _, said in late if said.header.sender == "robot1"] == [2.0]
    assert max(b.ticks) == pytest.approx(2.05)


def test_tokens_that_already_stand_are_told_to_a_latecomer() -> None:
    simulator, _, _ = pair()
    simulator.run(0.5)
    late = Talker("robot3")
    simulator.add(late, Journal(None, Heading(JOURNAL_VERSION, "robot3", 1, 0, {})))
    simulator.run(0.6)
    ups = sorted(said.name for _, said in late.heard if isinstance(said, PeerUp))
    assert ups == ["robot1", "robot2"]


def test_a_terminated_node_goes_when_its_last_words_are_out() -> None:
    simulator, a, _ = pair()
    simulator.run(0.5)
    simulator.terminate("robot1")
    assert a.finished
    assert simulator.names == ["robot2"]


def test_lost_messages_do_not_arrive() -> None:
    simulator, _, b = pair(Radio(loss=1.0))
    simulator.run(1.0)
    assert [said for _, said in b.poses() if said.header.sender == "robot1"] == []


def test_a_tap_hears_each_message_once_when_it_is_published() -> None:
    simulator, _, _ = pair()
    heard: list[tuple[float, Message]] = []
    simulator.taps.append(lambda now, _key, _payload, message: heard.append((now, message)))
    simulator.run(0.95)
    assert len(heard) == 20
    assert all(now == said.header.stamp for now, said in heard if not isinstance(said, Ask))


def test_a_halt_ends_a_run_with_the_call_under_way_and_the_next_run_goes_on_from_there() -> None:
    simulator, a, _ = pair()
    simulator.taps.append(lambda now, *_: simulator.halt() if now >= 0.3 else None)
    simulator.run(1.0)
    assert (simulator.now, len(a.ticks)) == (pytest.approx(0.3), 4)
    simulator.taps.clear()
    simulator.run(1.0)
    assert len(a.ticks) == 11
