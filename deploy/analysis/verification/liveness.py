"""Checkers of the invariants L1-L4 of protocol/README.md: after the last fault one robot leads the whole team again.

They hold within the bounds of the design's section 6, and need the facts `heals` and `over`. L5-L7, on who leads and
for how long, are in `leadership.py`.
"""

from __future__ import annotations

from lfa.deploy.analysis.verification.checker import LONG_AGO, Checker, shown
from lfa.protocol.lease.membership import team_of
from lfa.protocol.lease.timing import CLOCK_RATE_ERROR, Timing
from lfa.protocol.messages.consensus import Config, Member, Version
from lfa.protocol.messages.robot import CmdVel
from lfa.protocol.names import WITNESS_ID

NEVER = float("inf")
"""Time [s] after every event of a run."""
SETTLED_S = 1.0
"""Time [s] after t_remove in which chain and versions may still change (L2, L3)."""
CHANGE_HEARTBEATS = 5.0
"""Maximum time [heartbeats] for a change of the config to reach all members.

A new leader removes a dead voter t_remove after it started to lead, which may be later than L3's bound, and writes two
configs within a round trip each.
"""


class _AfterFaults(Checker):
    """Checker of an invariant that holds some time after the last fault."""

    def __init__(self, timing: Timing) -> None:
        super().__init__(timing)
        self.alive: dict[int, Member] = {}
        self.healed_at = NEVER
        self._corrected_by = NEVER
        self._step_s = timing.rank_step_s
        self._named: tuple[int, ...] | None = None
        """Robots that the mission names; None: all that are alive."""
        self._configs: dict[Member, Config] = {}

    def names(self, at: float, robots: tuple[int, ...]) -> None:
        self._named = robots

    def adopts(self, at: float, who: Member, config: Config) -> None:
        self._configs[who] = config

    @property
    def newest(self) -> Config | None:
        """Newest config that a live process knows."""
        return max(self._configs.values(), key=_version, default=None)

    @property
    def team(self) -> dict[int, Member]:
        """Robots that are alive and in the team of the newest config (E33, E34)."""
        newest = self.newest
        robots = {i: m for i, m in self.alive.items() if i != WITNESS_ID}
        if newest is None:
            return robots
        team = team_of(newest.roster, tuple(robots) if self._named is None else self._named)
        return {i: m for i, m in robots.items() if i in team}

    def lives(self, at: float, who: Member) -> None:
        self.alive[who.id] = who
        if self.healed_at <= at <= self._corrected_by:
            self.healed_at = at  # the last fault's restart under a wrong clock is corrected only now (E23)

    def ends(self, at: float, who: Member) -> None:
        self.alive.pop(who.id, None)
        self._configs.pop(who, None)

    def heals(self, at: float, step_s: float) -> None:
        self.healed_at, self._step_s = at, max(step_s, self._step_s)
        self._corrected_by = at + self.timing.grant_s

    @property
    def led_by(self) -> float:
        """Latest time [s] for a robot to lead: T_grant + 4 delta N after `healed_at`.

        delta is the value of the table for this network.
        """
        robots = sum(i != WITNESS_ID for i in self.alive)
        grant_s = self.timing.grant_s / (1.0 - CLOCK_RATE_ERROR)
        return self.healed_at + grant_s + 4.0 * self._step_s * robots

    @property
    def settled_by(self) -> float:
        return self.healed_at + self.timing.remove_silence_s + SETTLED_S


class OneActs(_AfterFaults):
    """Checker of L1: a leader command is accepted in time after the last fault, and one robot goes on leading."""

    name = "L1"

    def __init__(self, timing: Timing) -> None:
        super().__init__(timing)
        self._acting: tuple[float, int] | None = None
        """Time [s] of the first command after the faults of the robot that acts now, and its id."""

    def obeys(self, at: float, robot_id: int, cmd: CmdVel, age: float) -> None:
        if at < self.healed_at or not cmd.as_leader:
            return
        if self._acting is None or self._acting[1] != robot_id:
            self._acting = (at, robot_id)

    def over(self, at: float) -> None:
        if self._acting is None:
            self.broken(at, "nobody acted after the last fault")
        elif self._acting[0] > self.led_by:
            late_ms = (self._acting[0] - self.led_by) * 1000.0
            since = (self._acting[0] - self.healed_at) * 1000.0
            self.broken(at, f"robot {self._acting[1]} acts {since:.0f} ms after the last fault, {late_ms:.0f} ms late")


class AllInChain(_AfterFaults):
    """Checker of L2: the newest chain holds exactly the robots of the team that are alive."""

    name = "L2"

    def __init__(self, timing: Timing) -> None:
        super().__init__(timing)
        self._complete_since = NEVER

    def adopts(self, at: float, who: Member, config: Config) -> None:
        super().adopts(at, who, config)
        self._look(at)

    def lives(self, at: float, who: Member) -> None:
        super().lives(at, who)
        self._look(at)

    def ends(self, at: float, who: Member) -> None:
        super().ends(at, who)
        self._look(at)

    def _look(self, at: float) -> None:
        complete = set(self._chain()) == set(self.team.values())
        self._complete_since = min(self._complete_since, at) if complete else NEVER

    def _chain(self) -> tuple[Member, ...]:
        return () if self.newest is None else self.newest.chain

    def over(self, at: float) -> None:
        if self._complete_since > self.settled_by:
            chain = [shown(m) for m in self._chain()]
            alive = [shown(m) for _, m in sorted(self.team.items())]
            self.broken(at, f"chain {chain} since {self._complete_since:.3f}, alive are {alive}")
        retired = () if self.newest is None else self.newest.roster.retired
        still = [shown(m) for m in (self.newest.voters if self.newest is not None else ()) if m.id in retired]
        if still:
            self.broken(at, f"retired, and voters still: {still}")


class OneVersion(_AfterFaults):
    """Checker of L3: all live processes know the same version of the config."""

    name = "L3"

    def __init__(self, timing: Timing) -> None:
        super().__init__(timing)
        self._version: dict[int, Version] = {}
        self._differ_since: float | None = None

    def lives(self, at: float, who: Member) -> None:
        super().lives(at, who)
        self._version[who.id] = Version()
        self._look(at)

    def ends(self, at: float, who: Member) -> None:
        super().ends(at, who)
        self._version.pop(who.id, None)
        self._look(at)

    def adopts(self, at: float, who: Member, config: Config) -> None:
        super().adopts(at, who, config)
        self._version[who.id] = config.version
        self._look(at)

    def _look(self, at: float) -> None:
        if len(set(self._version.values())) > 1:
            self._differ_since = at if self._differ_since is None else self._differ_since
        else:
            self._judge(at)
            self._differ_since = None

    def _judge(self, at: float) -> None:
        """Check the time that the versions differed: they are equal again, or the run is over."""
        if self._differ_since is None:
            return
        change_s = CHANGE_HEARTBEATS * self.timing.heartbeat_s / (1.0 - CLOCK_RATE_ERROR)
        if at >= max(self.settled_by, self._differ_since + change_s):
            known = {i: f"{shown(v.term)}.{v.seq}" for i, v in sorted(self._version.items())}
            self.broken(at, f"versions differed since {self._differ_since:.3f}, and are {known}")

    def over(self, at: float) -> None:
        self._judge(at)


class Obeyed(_AfterFaults):
    """Checker of L4: gateways accept leader commands without a long gap, and at last a command of each robot."""

    name = "L4"

    def __init__(self, timing: Timing) -> None:
        super().__init__(timing)
        self._last = LONG_AGO
        self._silence: tuple[float, float] | None = None
        self._obeyed_at: dict[int, float] = {}
        """Time [s] of the last command that each robot's gateway accepted."""

    def obeys(self, at: float, robot_id: int, cmd: CmdVel, age: float) -> None:
        self._obeyed_at[robot_id] = at
        if cmd.as_leader:
            self._hear(at)

    def over(self, at: float) -> None:
        self._hear(at)
        if self._silence is not None:
            last, then = self._silence
            self.broken(then, f"no leader command obeyed for {(then - last) * 1000.0:.0f} ms")
        for robot_id in sorted(self.team):
            last = self._obeyed_at.get(robot_id, LONG_AGO)
            if at > self.settled_by + SETTLED_S and at - last > SETTLED_S:
                self.broken(at, f"no command of robot {robot_id} obeyed for {at - last:.1f} s")

    def _hear(self, at: float) -> None:
        """Check the gap since the last leader command: at most the deadman time plus the latency of a command."""
        patience_s = self.timing.deadman_s / (1.0 - CLOCK_RATE_ERROR) + self._step_s
        since = max(self._last, self.led_by) if self.healed_at < NEVER else at
        if at - since > patience_s and self._silence is None:
            self._silence = (since, at)
        self._last = at


def _version(config: Config) -> Version:
    return config.version


AFTER_FAULTS: tuple[type[Checker], ...] = (OneActs, AllInChain, OneVersion, Obeyed)
"""Checkers of L1-L4."""
