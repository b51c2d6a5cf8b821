"""Stop and resume of a running fleet over a session, for the commands and for bridges."""

from __future__ import annotations

from lfa.agents.orders.stop_listener import QUESTION
from lfa.deploy.client.operator import Operator
from lfa.deploy.client.session import Subscriber
from lfa.deploy.client.stop_call import StopCall, StopOutcome
from lfa.protocol import clock, incarnations
from lfa.protocol.messages.stop import StopReport, StopState
from lfa.protocol.messages.team import MissionNote
from lfa.protocol.names import robot_id_of, robot_name
from lfa.protocol.topics import DRIVER_PREFIX, address
from lfa.protocol.transport.message_bus import send

TOPICS = frozenset({"*/stop_state", "*/stop_known", "*/mission"})
"""Topics that a session must hear for `stop_fleet`."""
WAIT_S = 0.01


def stop_fleet(subscriber: Subscriber, *, stand: bool) -> StopOutcome:
    """Let the fleet of `subscriber` stand, or go again, and return who did, and who did not.

    Raises Refused for a resume where nothing is stopped, or where nobody answers.
    """
    operator = Operator(subscriber.fleet.name, incarnations.drawn())
    call = StopCall(stand, clock.now())
    call.name(tuple(agent.robot for agent in subscriber.fleet.team), all_known=False)
    while True:
        now = clock.now()
        if call.asks(now):
            send(subscriber.bus, *(operator.ask(what, now) for what in ("mission", QUESTION)))
        said = call.said(now)
        if said is not None:
            send(subscriber.bus, operator.stop(said.word, said.gateways, now))
        for arrival, message in subscriber.take():
            where = address(arrival.key)
            robot = None if where is None else robot_id_of(where.owner)
            match message:
                case StopState() if robot is not None:
                    call.hear(robot, message, clock.now())
                case MissionNote(mission=mission):
                    call.name(mission.robots)
                case StopReport(robots=robots) if robots:
                    call.name(robots)
        call.name(_living(subscriber), all_known=False)
        outcome = call.outcome(clock.now())
        if outcome is not None:
            return outcome
        subscriber.wait(WAIT_S)


def _living(subscriber: Subscriber) -> tuple[int, ...]:
    """Return the robots whose agent or driver runs."""
    names = (
        name.replace(DRIVER_PREFIX, "robot", 1) if name.startswith(DRIVER_PREFIX) else name
        for name in subscriber.living
    )
    return tuple(robot for name in names if (robot := robot_id_of(name)))


def outcome_lines(outcome: StopOutcome, *, stand: bool) -> list[str]:
    """Return the outcome as lines for people."""
    verb = "stopped" if stand else "may go"
    done = ", ".join(map(robot_name, outcome.done)) or "no robot"
    lines = [f"{verb}: {done} (epoch {outcome.epoch})"]
    if outcome.silent:
        state = "NOT STOPPED, no answer" if stand else "no answer, stays as it is"
        lines.append(f"{state}: {', '.join(map(robot_name, outcome.silent))}")
    if outcome.moving:
        lines.append(f"stopped, but wheels are not known to rest: {', '.join(map(robot_name, outcome.moving))}")
    if outcome.overruled:
        lines.append("somebody has said stop again in the meantime: it holds")
    if not (outcome.done or outcome.silent or outcome.moving):
        lines = [f"{'NOT STOPPED' if stand else 'no effect'}: no gateway answers; is the fleet running?"]
    return lines
