"""Time at which a process stands for election (E6), and starts without a quorum of a known config (E18-E21)."""

from __future__ import annotations

from lfa.protocol.lease.candidate import Candidate
from lfa.protocol.lease.failure_detector import FailureDetector
from lfa.protocol.lease.membership import all_member_ids, is_first, is_spare, rank
from lfa.protocol.lease.timing import Timing
from lfa.protocol.messages.consensus import Config, Member
from lfa.protocol.mission import Mission

NEVER = float("inf")
COLD_START_S = 3.0
"""Time [s] that a cold start waits for all ids with `cold_start = "majority"` (E19)."""
FORGET_GRANTS = 3
"""Validity of an operator's `forget` command, in units of T_grant: one attempt of each candidate in order (E20)."""


class Election:
    """Turn of one process to stand for election, and what the mission lets it do without a quorum."""

    def __init__(self, me: Member, mission: Mission, timing: Timing, now: float) -> None:
        self.me = me
        self.all_member_ids = all_member_ids(mission)
        self._members = frozenset(self.all_member_ids)
        self._may_lead = frozenset(i for i in mission.robots if mission.may_lead(i))
        self._spares_lead = mission.can_lead is None
        self.at = NEVER
        """Time [s] to stand for election."""
        self.base = now
        """Time [s] from which the candidates' delays count."""
        self.forget_until = now
        self._forget: tuple[Member, ...] = ()
        """Incarnations that the operator declared dead, until `forget_until` (E20)."""
        self._timing = timing
        self._place_of: tuple[Config, int, int] | None = None
        """Own place in the election order, behind the config and the number of vanishings that it was computed from."""
        majority = mission.cold_start == "majority" and mission.witness
        self._majority_from = now + COLD_START_S if majority else NEVER
        self._quorum_loss_s = mission.continue_after_s if mission.lonely == "continue_after" else NEVER
        self._quorum_lost_from = now + self._quorum_loss_s

    def may_lead(self, config: Config, robot_id: int) -> bool:
        """Return True if the mission allows this robot to lead, and `config` has it in its team (E33, E34)."""
        named = robot_id in self._may_lead or (self._spares_lead and is_spare(config.roster, robot_id))
        return named and robot_id not in config.roster.retired

    def takes_in(self, config: Config, robot_id: int) -> bool:
        """Return True if this id is of the team by the mission and the roster of `config`, the witness included."""
        known = robot_id in self._members or is_spare(config.roster, robot_id)
        return known and robot_id not in config.roster.retired

    def rank(self, config: Config, robot_id: int, peers: FailureDetector) -> int:
        """Return the number of robots that stand before this one (E6)."""
        return rank(config, robot_id, lambda other: not self.may_lead(config, other.id) or peers.is_gone(other))

    def after(self, at: float, config: Config, peers: FailureDetector) -> None:
        """Schedule the candidacy for `at` [s] plus this robot's rank times `rank_step_s` (E6)."""
        self.base = at
        if not self.may_lead(config, self.me.id):
            self.at = NEVER
            return
        self.at = at + self._place(config, peers) * self._timing.rank_step_s

    def _place(self, config: Config, peers: FailureDetector) -> int:
        """Return the own place in the election order. Each PROPOSE asks for it, and a chain may be of a hundred."""
        known = self._place_of
        if known is not None and known[0] is config and known[1] == peers.vanishings:
            return known[2]
        # A robot without a vote stands last: it is needed only when no voter can lead.
        named = is_first(config) or self.me in config.voters
        place = self.rank(config, self.me.id, peers) + (0 if named else len(config.voters))
        self._place_of = config, peers.vanishings, place
        return place

    def held(self, now: float) -> None:
        """Record that a lease is held at `now` [s], which restarts the time to E21."""
        self._quorum_lost_from = now + self._quorum_loss_s

    def forget(self, lost: tuple[Member, ...], now: float) -> None:
        """Take an operator's declaration that the incarnations `lost` are dead; it ends by itself (E20)."""
        self._forget, self.forget_until = lost, now + FORGET_GRANTS * self._timing.grant_s

    def forgotten(self, now: float) -> tuple[Member, ...]:
        """Return the incarnations that are declared dead at `now` [s]."""
        return self._forget if now < self.forget_until else ()

    def without_quorum(
        self, candidate: Candidate, config: Config, peers: FailureDetector, now: float
    ) -> tuple[Member, ...]:
        """Return the members of a fresh config if no quorum of the known one answers (E18, E19, E21); else ()."""
        incarnations = candidate.full_house(config, self.all_member_ids, peers.is_superseded)
        if not incarnations and is_first(config) and now >= self._majority_from:
            incarnations = candidate.blank_majority(self.all_member_ids, peers.is_superseded)
        asked_all = now >= candidate.began_at + self._timing.heartbeat_s
        if not incarnations and not is_first(config) and now >= self._quorum_lost_from and asked_all:
            everybody = (*self.all_member_ids, *(spare.id for spare in config.roster.spares))
            incarnations = candidate.any_answering(everybody, peers.is_superseded)
        return incarnations
