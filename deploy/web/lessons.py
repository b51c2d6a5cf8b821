"""Lessons of the page: guided scenes of a minute, each with the protocol's words for what is seen. Pure."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from msgspec import Struct

from lfa.deploy.view.picture.picture import Picture
from lfa.deploy.web.share import Setting

SWING_S = 3.0
Seen = Callable[[Sequence[Picture]], bool]
Actions = Callable[[Sequence[Picture]], list[str]]


class Step(Struct, frozen=True):
    """One step of a lesson: what to look at or to do, the rule behind it, and what ends the step."""

    says: str
    rule: str
    until: Seen
    actions: Actions | None = None
    """Faults, without times, that do for the reader what the step asks; None if the step only asks to look."""


class Lesson(Struct, frozen=True):
    """Guided scene: a run, and steps to take in it."""

    key: str
    title: str
    setting: Setting
    steps: tuple[Step, ...]
    panes: Mapping[str, tuple[str, ...]] = {}
    """Two teams side by side: the label of each, and what is set for it."""


class Lecture:
    """Lesson in progress: `step` is the index of the present step, the number of steps once all are done."""

    def __init__(self, lesson: Lesson) -> None:
        self.lesson = lesson
        self.step = 0

    def see(self, pictures: Sequence[Picture]) -> None:
        """Go on to the next step when the present one has been taken."""
        if self.step < len(self.lesson.steps) and self.lesson.steps[self.step].until(pictures):
            self.step += 1

    def actions(self, pictures: Sequence[Picture]) -> list[str]:
        """Return the faults that take the present step."""
        steps = self.lesson.steps
        actions = steps[self.step].actions if self.step < len(steps) else None
        return [] if actions is None else actions(pictures)

    def scene(self) -> dict[str, Any]:
        steps = [{"says": s.says, "rule": s.rule, "shows": s.actions is not None} for s in self.lesson.steps]
        return {"key": self.lesson.key, "title": self.lesson.title, "steps": steps}


def _leads(robot: int, after_s: float = 0.0) -> Seen:
    return lambda pictures: pictures[0].leader == robot and pictures[0].t >= after_s


def _another_leads(pictures: Sequence[Picture]) -> bool:
    return len({lead["robot"] for lead in pictures[0].leaders.leads}) > 1


def _settled(seconds: float) -> Seen:
    """Return whether the newest leader has led for so long [s]."""
    return lambda ps: bool(ps[0].leaders.leads) and ps[0].t >= ps[0].leaders.leads[-1]["t"] + seconds


def _ordered(side: str) -> Seen:
    """Return whether a formation was ordered, and the team has had the time to take it."""
    return lambda ps: any(ordered == side and ps[0].t >= at_s + SWING_S for at_s, ordered in ps[0].sides)


def _ahead_of(x: float) -> Seen:
    """Return whether all robots are beyond `x` [m]."""
    return lambda ps: all((ps[0].where(robot) or (-1e9, 0.0))[0] > x for robot in ps[0].robots)


def _stands(robot: int) -> Seen:
    return lambda pictures: abs(pictures[0].speed(robot)) < 0.01


def _lost_leader(pictures: Sequence[Picture]) -> bool:
    return len(pictures[0].leaders.leads) > 1 or pictures[0].leaders.stepped_down


def _do(*faults: str) -> Actions:
    return lambda _: list(faults)


_FREE = ("faults=[]",)
_DOOR = (
    "mission.leading.route_m=[[12.0, 0.0]]",
    "mission.formation.side=left",
    "world.walls_m=[[6.0, -4.0, 6.0, -0.7], [6.0, 0.7, 6.0, 4.0]]",
)

LESSONS: tuple[Lesson, ...] = (
    Lesson(
        "killed",
        "Kill the leader",
        Setting("leader_killed", overrides=_FREE),
        (
            Step(
                "Press play. Robot 1 asks the others for their votes and leads; the others take their slots behind it.",
                "A leader leads only while it holds the lease: a majority of the voters has bound itself to it for a "
                "short time, and it renews that bond before it runs out.",
                _leads(1, 3.0),
                _do(),
            ),
            Step(
                "Now click robot 1 and choose Kill. Its process ends at once, without any message.",
                "Nobody needs a farewell: with the process its liveliness token vanishes, and every other robot hears "
                "of it within milliseconds.",
                lambda pictures: pictures[0].role(1) == "gone",
                _do("kill 1"),
            ),
            Step(
                "Look at the lease's line: robot 2 leads.",
                "The next in the chain asks for a higher term. The voters' bonds to robot 1 must have run out, or its "
                "wheels must be fenced, before they may promise: so two never lead at once.",
                _another_leads,
            ),
            Step(
                "The chain closes over the gap, and the team drives on to its goal.",
                "The new leader publishes a config without robot 1; who followed it now follows the one before.",
                _settled(3.0),
            ),
        ),
    ),
    Lesson(
        "partition",
        "Cut the network in two",
        Setting("leader_killed", overrides=_FREE),
        (
            Step(
                "Press play and wait until robot 1 leads.",
                "Four robots and the witness vote: five voters, so three are a majority.",
                _leads(1, 4.0),
                _do(),
            ),
            Step(
                "Cut the network: robots 1 and 2 on one side, 3, 4 and the witness on the other.",
                "No message crosses. Neither side knows whether the other one is dead.",
                lambda pictures: pictures[0].is_cut,
                _do("cut 1,2-3,4,w"),
            ),
            Step(
                "Robots 1 and 2 stand: two voters are no majority, and the old lease runs out. Robot 3 leads.",
                "Who cannot renew its lease stops its wheels before the bonds end; the other side may elect only "
                "after that. At no moment do two lead.",
                lambda pictures: pictures[0].leader == 3 and _stands(1)(pictures),
            ),
            Step(
                "Heal the network: the two sides become one chain again, behind the leader of the higher term.",
                "A term is never used twice, and the higher one counts. Those who come back join at the tail.",
                lambda pictures: not pictures[0].is_cut and len(pictures[0].chain) == 4,
                _do("heal"),
            ),
        ),
    ),
    Lesson(
        "stuck",
        "A leader that is stuck",
        Setting("dead_end"),
        (
            Step(
                "Press play. The leader drives towards a dead end with its team behind it.",
                "The leader sees only what its laser sees: it cannot know yet that this way leads nowhere.",
                lambda pictures: pictures[0].leader is not None and pictures[0].t > 3.0,
                _do(),
            ),
            Step(
                "It drives in, and finds no way on: it hands its lease to the next in the chain.",
                "A stuck leader lives, so nobody's timeout helps. It steps down itself (E22): its command ends, and "
                "the next in the chain gets the lease without waiting for any bond to run out.",
                lambda pictures: any("stuck" in lead["why"] for lead in pictures[0].leaders.leads),
            ),
            Step(
                "The new leader turns the team around, and the old one leaves the trap last.",
                "The old leader keeps its vote and follows at the tail.",
                _settled(5.0),
            ),
        ),
    ),
    Lesson(
        "door",
        "Left, right, column: through a door",
        Setting("straight", overrides=_DOOR),
        (
            Step(
                "Press play. The followers keep to the left of each other's tracks.",
                "A slot is a distance and an angle behind the predecessor; the leader orders the angle.",
                _leads(1, 3.0),
                _do(),
            ),
            Step(
                "Order the formation Right, and watch the slots swing over.",
                "The operator asks, the leader orders: a formation counts with its leader's term, so that an old "
                "leader's order means nothing.",
                _ordered("right"),
                _do("formation right"),
            ),
            Step(
                "A door of 1.4 m comes up. Order a column before it, or wait until the leader does.",
                "Each slot now lies exactly behind its predecessor.",
                _ordered("column"),
                _do("formation column"),
            ),
            Step(
                "One after the other they pass.",
                "A follower avoids what it meets by itself; being in column it meets nothing.",
                _ahead_of(6.3),
            ),
        ),
    ),
    Lesson(
        "loss",
        "Turn up the loss until it breaks",
        Setting("leader_killed", overrides=(*_FREE, "time_limit_s=300.0")),
        (
            Step(
                "Press play and wait until robot 1 leads.",
                "A leader renews its lease several times within the bond's length: it needs one answer of a majority.",
                _leads(1, 3.0),
                _do(),
            ),
            Step(
                "Drag the loss to 20 %. Nothing changes: the next renewal comes before the bond ends.",
                "Every message is sent anew with fresh content; nothing waits for one that was lost.",
                lambda pictures: pictures[0].loss_ordered >= 0.2,
                _do("loss 0.2"),
            ),
            Step(
                "Drag it up to 100 %. The leader stops.",
                "Without answers the lease runs out, and whose lease has run out commands nothing: it stops in time.",
                _lost_leader,
                _do("loss 1"),
            ),
            Step(
                "Drag it back to 0: somebody leads again.",
                "The voters remember their promises; a new term begins.",
                lambda pictures: pictures[0].loss_ordered < 0.05 and _settled(1.0)(pictures) and _moves(pictures),
                _do("loss 0"),
            ),
        ),
    ),
    Lesson(
        "controllers",
        "Two controllers side by side",
        Setting("circle"),
        (
            Step(
                "Press play: the same team on the same circle, above with the controller law, below with kanayama.",
                "A controller is one class: it gets where the slot is and how it moves, and answers with a twist. "
                "Limits, stale data and obstacles stay the robot's business.",
                lambda pictures: all(picture.t > 5.0 for picture in pictures),
                _do(),
            ),
            Step(
                "Compare the distance errors after twenty seconds.",
                "Both keep the slot; they differ in how they turn an error into speed and turn rate.",
                lambda pictures: all(picture.t > 20.0 for picture in pictures),
            ),
        ),
        {"law": (), "kanayama": ("mission.following.controller=kanayama",)},
    ),
)


def _moves(pictures: Sequence[Picture]) -> bool:
    leader = pictures[0].leader
    return leader is not None and pictures[0].speed(leader) > 0.05
