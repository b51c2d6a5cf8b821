"""Engine of the page in virtual time: one team, or two side by side, simulated in the server at any speed.

Whatever the page does to the teams is a fault of the scenario's grammar, at a time on a grid of 10 ms that has not come
yet: the saved scenario then runs to the same events, byte for byte.
"""

from __future__ import annotations

from math import floor, hypot, inf
from time import perf_counter
from typing import Any

from lfa.deploy.faults.link_faults import goal_of
from lfa.deploy.faults.script import GOAL, LEADER, Fault, parse, parse_all
from lfa.deploy.recording.recorder import EventLines
from lfa.deploy.run.simulate import SimulatedRun, refuse_faults
from lfa.deploy.scenario_loading import load_scenario
from lfa.deploy.view.picture.ground import ground_of
from lfa.deploy.view.picture.picture import TOPICS, Picture
from lfa.deploy.web.engine import robot_under
from lfa.deploy.web.lessons import LESSONS, Lecture, Lesson
from lfa.deploy.web.share import FAULTS_MAX, Setting, fragment_of, saved, setting_of
from lfa.protocol.errors import Refused
from lfa.protocol.messages.codec import Message
from lfa.protocol.topics import address
from lfa.world.description.load import Point, Scenario, draw, shipped

GRID_S = 0.01
"""Grid [s] of the times at which orders take effect."""
STEP_S = 0.1
"""Virtual time [s] of a single step."""
WORK_S = 0.025
"""Longest work [s] in one call, so that the server answers meanwhile."""
STEP_WORK_S_MAX = 5.0
SPEED_MIN, SPEED_MAX = 0.1, 1000.0
LATE_S_MAX = 0.2
"""Longest time [s] that is made up for after the server was busy."""
SLICE_S = 0.02
RUNNING_NEEDED = ("kill", "stop", "continue", "terminate")


class _Team:
    """One simulated team with its picture and its event log."""

    def __init__(self, scenario: Scenario, seed: int, faults: list[Fault]) -> None:
        self.drawn = draw(scenario, seed)
        refuse_faults(self.drawn, faults)
        self.picture = Picture(scenario.mission.robots)
        self._log = EventLines()
        self.events = bytearray()
        """Lines of events.jsonl so far."""
        self.run = SimulatedRun(self.drawn, seed, faults, self._see, None)
        self._closed = False
        self.advance(SLICE_S, inf)  # so that there is something to see before the first step

    def advance(self, until: float, deadline: float) -> None:
        """Go on to virtual time `until` [s], at most up to the real time `deadline` [s]."""
        self.run.advance(until, lambda: perf_counter() > deadline)
        if self.run.verdict is not None and not self._closed:
            self._closed = True
            self.run.close()

    def _see(self, t: float, key: str, message: Message) -> None:
        where = address(key)
        if where is not None and where.topic in TOPICS:
            self.picture.see(t, where.owner, where.topic, message)
        self.events += self._log.lines(t, key, message)


class VirtualEngine:
    """Engine of simulated teams; `allowed` is a scenario's file that may be opened besides the shipped ones."""

    def __init__(self, setting: Setting, lesson: Lesson | None = None, allowed: str | None = None) -> None:
        """Load and start. Raises Refused."""
        self._allowed = allowed
        self.number = 0
        self._scans: set[int] = set()
        self._open(setting, lesson)

    @property
    def pictures(self) -> list[Picture]:
        return [team.picture for team in self._teams]

    @property
    def now(self) -> float:
        """Virtual time [s] that all teams have reached."""
        return min(team.run.now for team in self._teams)

    @property
    def over(self) -> bool:
        return all(team.run.verdict is not None for team in self._teams)

    @property
    def events(self) -> list[bytes]:
        """Lines of events.jsonl of each team so far."""
        return [bytes(team.events) for team in self._teams]

    def _open(self, setting: Setting, lesson: Lesson | None) -> None:
        """Start the run of a setting, in place of the present one; on Refused the present one goes on."""
        labels = lesson.panes if lesson is not None and lesson.panes else {"": ()}
        teams = []
        for more in labels.values():
            scenario = load_scenario(setting.scenario, (*setting.overrides, *more), setting.robots)
            seed = scenario.seed if setting.seed is None else setting.seed
            faults = parse_all(scenario.mission, scenario.faults, setting.faults)
            teams.append(_Team(scenario, seed, faults))
        self._teams, self._labels, self._setting, self._seed = teams, list(labels), setting, seed
        self._lecture = None if lesson is None else Lecture(lesson)
        self._done: list[str] = list(setting.faults)
        self._playing, self._speed, self._target = False, 1.0, 0.0
        self._stepped_at = perf_counter()
        self.number += 1

    def scene(self) -> dict[str, Any]:
        scenario = self._teams[0].drawn
        return {
            "engine": "virtual",
            "title": scenario.title,
            "scenario": scenario.name,
            "seed": self._seed,
            "panes": [ground_of(team.drawn, label) for team, label in zip(self._teams, self._labels, strict=True)],
            "scenarios": sorted(shipped_titles()),
            "lessons": [[lesson.key, lesson.title] for lesson in LESSONS],
            "lesson": None if self._lecture is None else self._lecture.scene(),
        }

    def state(self) -> dict[str, Any]:
        verdicts = [team.run.verdict for team in self._teams]
        radio = self._teams[0].run.radio
        return {
            "playing": self._playing,
            "speed": self._speed,
            "over": " / ".join(v.outcome + (f": {v.reason}" if v.reason else "") for v in verdicts if v is not None)
            if self.over
            else "",
            "faults": [*self._teams[0].drawn.faults, *self._done],
            "link": fragment_of(self._setting_now()),
            "loss": radio.loss,
            "range": radio.range_m,
            "step": None if self._lecture is None else self._lecture.step,
        }

    def advance(self) -> None:
        """Go on by the real time since the last call, at the chosen speed, for at most `WORK_S` of work."""
        now = perf_counter()
        passed_s, self._stepped_at = min(now - self._stepped_at, LATE_S_MAX), now
        if self._lecture is not None:
            self._lecture.see(self.pictures)
        if not self._playing or self.over:
            self._playing = self._playing and not self.over
            return
        self._target = min(self._target + passed_s * self._speed, self.now + LATE_S_MAX * max(self._speed, 1.0))
        self._until(self._target, now + WORK_S)

    def _until(self, target: float, deadline: float) -> None:
        """Advance all teams to the same virtual time, slice by slice."""
        while (here := self.now) < target and not self.over and perf_counter() < deadline:
            for team in self._teams:
                if team.run.now <= here and team.run.verdict is None:
                    team.advance(min(target, here + SLICE_S), deadline)
            if any(team.run.verdict is not None for team in self._teams) and self.now <= here:
                break

    def obey(self, order: dict[str, Any]) -> dict[str, Any]:
        match order:
            case {"do": "play"}:
                self._playing, self._target = not self.over, self.now
            case {"do": "pause"}:
                self._playing = False
            case {"do": "step"}:
                self._playing = False
                self._until(self.now + STEP_S, perf_counter() + STEP_WORK_S_MAX)
            case {"do": "speed", "value": int() | float() as value}:
                self._speed, self._target = min(max(float(value), SPEED_MIN), SPEED_MAX), self.now
            case {"do": "fault", "text": str(text)}:
                return {"said": self._fault(text)}
            case {"do": "again"}:
                self._open(self._setting, None if self._lecture is None else self._lecture.lesson)
            case {"do": "open", "link": str(link)}:
                setting = setting_of(link)
                self._may_open(setting.scenario)
                self._open(setting, None)
            case {"do": "lesson", "key": str(key)}:
                self._learn(key)
            case {"do": "show"} if self._lecture is not None:
                for text in self._lecture.actions(self.pictures):
                    self._fault(text)
                self._playing = True
            case {"do": "save"}:
                return {"saved": saved(self._teams[0].drawn, self._seed, tuple(self._done)), "name": self._file_name()}
            case {"do": "scan", "robot": int() as robot, "on": bool(on)}:
                (self._scans.add if on else self._scans.discard)(robot)
                for picture in self.pictures:
                    picture.wanted_scans = self._scans
            case _:
                raise Refused(f"{str(order.get('do'))[:20]}: no such order, or not for a team in virtual time")
        return {}

    def _learn(self, key: str) -> None:
        lesson = next((lesson for lesson in LESSONS if lesson.key == key), None)
        if lesson is None:
            raise Refused(f"lesson {key[:20]}: must be one of {', '.join(lesson.key for lesson in LESSONS)}")
        self._open(lesson.setting, lesson)

    def _fault(self, text: str) -> str:
        """Schedule a fault for the next point of the grid; return it as a sentence. Raises Refused."""
        if self.over:
            raise Refused("the run is over: start it again first")
        if len(self._done) >= FAULTS_MAX:
            raise Refused(f"{FAULTS_MAX} faults in one session: save it, and start again")
        latest = max(team.run.now for team in self._teams)
        at_s = (floor(latest / GRID_S + 1e-6) + 1) * GRID_S
        mission, picture = self._teams[0].drawn.mission, self._teams[0].picture
        words = text.strip().split()
        if words[1:] == [LEADER]:
            if picture.leader is None:
                raise Refused(f"{text}: nobody leads at the moment")
            words[1] = str(picture.leader)
        fault = parse(f"{' '.join(words)} at {at_s:.2f} s", mission, "order")
        for team in self._teams:
            refuse_faults(team.drawn, [fault])
        if (
            fault.action in RUNNING_NEEDED
            and fault.target in mission.robots
            and picture.role(int(fault.target)) == "gone"
        ):
            raise Refused(f"{text}: robot {fault.target} does not run, restart it first")
        if fault.action == "restart" and picture.role(int(fault.target)) != "gone":
            raise Refused(f"{text}: robot {fault.target} runs")
        if fault.action == "obstacle":
            self._check_free(str(fault.target))
        if fault.action == GOAL:
            self._check_uncovered(goal_of(str(fault.target)))
        for team in self._teams:
            team.run.add_fault(fault)
        self._done.append(str(fault))
        return str(fault)

    def _check_free(self, target: str) -> None:
        x, y, radius_m = map(float, target.split(","))
        for team in self._teams:
            mission = team.drawn.mission
            under = robot_under(team.picture, mission.robots, x, y, radius_m + mission.radius_m)
            if under is not None:
                raise Refused(f"obstacle {target}: robot {under} stands there, must be on free ground")

    def _check_uncovered(self, goal: Point) -> None:
        x, y = goal
        for team in self._teams:
            radius_m = team.drawn.mission.radius_m
            if any(hypot(x - at_x, y - at_y) < size_m + radius_m for at_x, at_y, size_m in team.picture.added):
                raise Refused(f"goal ({x:g}, {y:g}): an obstacle was set down there, must be clear of it")

    def _may_open(self, scenario: str) -> None:
        if scenario not in shipped_titles() and scenario != self._allowed:
            raise Refused(
                f"scenario {scenario[:60]!r}: must be a shipped one, or the one that lfa web was started with"
            )

    def _setting_now(self) -> Setting:
        s = self._setting
        return Setting(s.scenario, s.seed, s.robots, s.overrides, tuple(self._done))

    def _file_name(self) -> str:
        return f"{self._teams[0].drawn.name}-session.toml"

    def close(self) -> None:
        """Do nothing: a simulated team holds nothing outside the process."""


_titles: dict[str, str] = {}


def shipped_titles() -> dict[str, str]:
    """Return the titles of the shipped scenarios by their names; read once."""
    if not _titles:
        _titles.update({name: scenario.title for name, scenario in shipped().items()})
    return _titles
