"""Stuck detection: conditions S1 to S6 of control.md section 7, each with its reason as text, and the release."""

from __future__ import annotations

from collections import deque
from math import floor, hypot

from lfa.agents.avoidance.decision import Action
from lfa.protocol.geometry import Pose2D, Twist, distance

STILL_S, STILL_M = 3.0, 0.10
STANDS_S = 20.0
"""Maximum time [s] that a leader with a target stands, whatever keeps its command small, and that team-mates hold a
follower: longer than a leader waits for its team or for a moving obstacle."""
WANTED_MPS = 0.05
BLOCKED_S = 1.5
TURNS, TURNS_S = 3, 10.0
BACK_S = 5.0
CELL_M, CELL_ENTRIES, CELL_S = 0.5, 3, 30.0
WAITING_S = 10.0
SCAN_LOST = "S5: no scan comes any more"
POSE_LOST_S, NEVER_PLACED_S = 1.0, 3.0
"""Time [s] without a pose from which a robot counts as stuck (S6), once it had one, and after its start."""
POSE_LOST = "S6: own pose lost"
COMES_BACK = "S3: in the same place again and again"
TURN_S_MIN = 1.0
"""Minimum time [s] between two U-turns; nearer ones count as one, since the action flickers."""
FREED_M = 0.5
"""Distance [m] from the place where it got stuck at which a robot is free again."""
CALM_S = 5.0
"""Time [s] without any condition after which a robot is free again."""


class StuckMonitor:
    """Stuck state of one robot: from the first condition that holds until it is free again."""

    def __init__(self, *, again: bool = True) -> None:
        self._stuck = StuckConditions(again=again)
        self._at: Pose2D | None = None
        self._held_at = 0.0
        self._stands: tuple[float, Pose2D] | None = None
        """Time since which, and pose at which, a leader that should move has stood, the time left out in which it
        planned its way."""
        self._watched_at = 0.0
        self.reason: str | None = None
        self.backing_out = False
        """True while the robot backs out: it stays stuck until it is out of the place."""

    def begin(self, *, leading: bool) -> None:
        """Start a new role. A leader starts anew; a robot that was stuck as leader stays stuck as a follower."""
        self._stuck.reset()
        self._stands = None
        if leading:
            self.out()

    def watch(
        self,
        pose: Pose2D,
        wanted: Twist,
        action: Action | None,
        lost: str | None,
        now: float,
        *,
        leads: bool,
        again: bool = True,
        moving: bool = False,
        plans: bool = False,
        hung_at: Pose2D | None = None,
    ) -> None:
        """Update in a control step on the way; arguments as of `StuckConditions.watch`. `leads`: a leader that should
        move, or a follower that would and that only limits hold, such as a team-mate before it. Without `again`, coming
        back (S3) does not count now: a planned way does. `moving`: what is avoided moves. `plans`: a leader that
        searches its way.
        """
        since_s, self._watched_at = now - self._watched_at, now
        if self.backing_out:
            return
        held = self._stuck.watch(pose, wanted, action, lost, now, moving=moving, hung_at=hung_at)
        if held == COMES_BACK and not again:
            held = None
        if plans and self._stands is not None:
            self._stands = self._stands[0] + since_s, self._stands[1]
        elif not leads:
            self._stands = None
        elif self._stands_for_s(pose, now) >= STANDS_S and held is None:
            held = "S1: stands on its way"
        if held is None:
            self._ease(pose, now)
            return
        if self.reason is None or self._at is None:
            self._at = pose
        self.reason, self._held_at = held, now

    def lose_pose(self, missing: str) -> None:
        """Update in a control step without a pose, for want of the input `missing`."""
        self._stuck.reset()
        self._stands = None
        self.reason, self._at = f"{POSE_LOST}, no {missing}", None

    def find_pose(self) -> None:
        """Update in the first control step with a pose."""
        if self.reason is not None and self.pose_lost:
            self.reason = None

    @property
    def pose_lost(self) -> bool:
        """True while the robot is stuck because it has no pose."""
        return self.reason is not None and self.reason.startswith(POSE_LOST)

    def rest(self, pose: Pose2D, now: float) -> None:
        """Update in a control step in which no motion is wanted."""
        self._stuck.reset()
        self._stands = None
        self._ease(pose, now)

    def out(self) -> None:
        """Release the robot: it has left the place."""
        self.reason, self._at, self.backing_out = None, None, False
        self._stuck.reset()

    def _stands_for_s(self, pose: Pose2D, now: float) -> float:
        """Return how long [s] the robot has been within `STILL_M` of one place."""
        if self._stands is None or distance(pose, self._stands[1]) >= STILL_M:
            self._stands = now, pose
        return now - self._stands[0]

    def _ease(self, pose: Pose2D, now: float) -> None:
        if self.reason is None or self._at is None or self.backing_out:
            return
        freed = hypot(pose.x - self._at.x, pose.y - self._at.y) >= FREED_M
        if freed or now - self._held_at >= CALM_S or self.reason == SCAN_LOST:
            self.out()


class StuckConditions:
    """Conditions S1 to S5 of one robot that has a pose and is on its way; `reset` on arrival, while it waits for its
    team, and on a restart.
    """

    def __init__(self, *, again: bool = True) -> None:
        """Create the conditions. Without `again`, U-turns and coming back (S3) do not count: an explorer does both."""
        self._again = again
        self._moved: deque[tuple[float, float, float]] = deque()
        self._action: Action | None = None
        self._since = 0.0
        self._turns: deque[float] = deque(maxlen=TURNS)
        self._cell: tuple[int, int] | None = None
        self._entered: tuple[float, float] | None = None
        """Position where the cell was entered: noise on a border does not count as a new entry."""
        self._entries: dict[tuple[int, int], deque[float]] = {}
        self._avoided = False
        """True once something that stands was avoided since the last cell was entered."""

    def reset(self) -> None:
        self.__init__(again=self._again)  # type: ignore[misc]

    def watch(
        self,
        pose: Pose2D,
        wanted: Twist,
        action: Action | None,
        lost: str | None,
        now: float,
        *,
        moving: bool = False,
        hung_at: Pose2D | None = None,
    ) -> str | None:
        """Return the reason why the robot is stuck, or None. `action` is its present decision's, `wanted` before
        limits, `lost` the reason of S5 while an input that it needs is missing. `moving`: the decision is about what
        moves; a robot that comes back after it has given way is in no trap. `hung_at` is the place that the fixes say
        while the wheels drive on: they may slip.
        """
        self._note(pose, action, moving, now)
        if lost is not None:
            return lost
        if action is Action.WAIT and now - self._since > WAITING_S:
            return "S4: waited too long for what moves"
        if action is Action.BLOCKED and now - self._since > BLOCKED_S:
            return "S2: blocked on all sides"
        if action is Action.BACK and now - self._since > BACK_S:
            return "S3: backs off without end"
        if self._again and len(self._turns) == TURNS and now - self._turns[0] <= TURNS_S:
            return "S3: turned round again and again"
        if self._again and self._comes_back(now):
            return COMES_BACK
        return "S1: commanded to move, and did not" if self._does_not_move(hung_at or pose, wanted, now) else None

    def _note(self, pose: Pose2D, action: Action | None, moving: bool, now: float) -> None:
        if action != self._action:
            self._action, self._since = action, now
            if action is Action.U_TURN and (not self._turns or now - self._turns[-1] >= TURN_S_MIN):
                self._turns.append(now)
        self._avoided = self._avoided or (action is not None and not moving)
        cell = (floor(pose.x / CELL_M), floor(pose.y / CELL_M))
        far = self._entered is None or hypot(pose.x - self._entered[0], pose.y - self._entered[1]) > 0.5 * CELL_M
        if cell != self._cell and far:
            self._cell, self._entered = cell, (pose.x, pose.y)
            avoided, self._avoided = self._avoided, False
            if not avoided:  # it follows its slot, which may swing in the open, or a route that crosses itself
                return
            self._entries.setdefault(cell, deque(maxlen=CELL_ENTRIES)).append(now)
            if len(self._entries) > 256:
                self._entries.pop(next(iter(self._entries)))

    def _comes_back(self, now: float) -> bool:
        """Return whether the robot entered its cell `CELL_ENTRIES` times lately: that many are kept, the oldest
        first.
        """
        entries = self._entries.get(self._cell) if self._cell is not None else None
        return entries is not None and len(entries) == CELL_ENTRIES and now - entries[0] <= CELL_S

    def _does_not_move(self, pose: Pose2D, wanted: Twist, now: float) -> bool:
        if abs(wanted.linear_x) < WANTED_MPS:
            self._moved.clear()
            return False
        self._moved.append((now, pose.x, pose.y))
        while self._moved[0][0] < now - STILL_S:
            self._moved.popleft()
        first_at, x, y = self._moved[0]
        if now - first_at < STILL_S - 0.1 or hypot(pose.x - x, pose.y - y) >= STILL_M:
            return False
        return all(hypot(px - x, py - y) < STILL_M for _, px, py in self._moved)  # nor did it go there and back
