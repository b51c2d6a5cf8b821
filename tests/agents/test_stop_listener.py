"""Questions about the fleet stop at one agent: agents that start and operators ask it (E28, E30)."""

from __future__ import annotations

from lfa.agents.orders.stop_listener import ANSWER_S_MIN, QUESTION, StopListener
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.stop import UNCERTAIN, StopReport
from lfa.protocol.messages.team import Ask
from lfa.protocol.outbox import Outbox

ASK = Ask(Header("operator", 1, 1, 0.0), QUESTION)


def test_e28_an_agent_tells_who_asks_which_robots_the_team_has() -> None:
    outbox = Outbox("f", "robot2", 5)
    StopListener(2, (1, 2, 3), outbox).receive(ASK, 1.0)
    (report,) = [envelope.message for envelope in outbox.drain()]
    assert isinstance(report, StopReport)
    assert (report.known, report.robots) == (UNCERTAIN, (1, 2, 3))


def test_questions_of_one_moment_get_one_answer() -> None:
    outbox = Outbox("f", "robot2", 5)
    listener = StopListener(2, (1, 2, 3), outbox)
    for now in (1.0, 1.0 + 0.5 * ANSWER_S_MIN, 1.0 + ANSWER_S_MIN):
        listener.receive(ASK, now)
    assert len(outbox.drain()) == 2
