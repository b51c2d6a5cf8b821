"""One stop or resume as its operator's side runs it: count up, repeat, and know who has answered (E29). Pure.

A stop is said at once; an answer with a later resume makes it count up. A resume asks first, and is one more than the
newest stop that it heard of: a stop said after that wins over it.
"""

from __future__ import annotations

from math import inf

from msgspec import Struct

from lfa.protocol.errors import Refused
from lfa.protocol.messages.consensus import Member
from lfa.protocol.messages.stop import EPOCH_FREE, EPOCH_MAX, NO_STOP, StopState, StopWord

REPEAT_S = 0.03
ANSWER_S = 0.9
"""Time [s] within which every gateway answers, or is named."""
BRAKED_S, NEWS_S = 0.8, 0.2
"""Time [s] within which a robot that has answered comes to rest; after it, the silence [s] for which it is named."""
REST_S = 4.0
"""Time [s] within which a robot that goes on answering comes to rest, or is named."""
ASK_S = 0.1
"""Time [s] between two questions which robots the fleet has, until somebody has told all."""
KEPT_S = 0.3
"""Time [s] for which the word is repeated to a robot that stands, until its agent knows it too."""
EPOCHS_APART = 1000
"""Number of words by which gateways are apart at most that have heard the same operators."""
KNOWN_S = 0.4
"""Time [s] within which a fleet says which robots it has."""


class Said(Struct, frozen=True):
    """Order to publish: the fields of a `StopOrder`."""

    word: StopWord | None
    gateways: tuple[Member, ...]


class StopOutcome(Struct, frozen=True):
    """Result of a stop or resume, of all robots known."""

    epoch: int
    done: tuple[int, ...]
    """Robots that stand, or for a resume may go."""
    silent: tuple[int, ...]
    """Robots whose gateway has not answered to this word: after a stop they may still drive."""
    moving: tuple[int, ...]
    """Robots whose gateway has stopped, and whose wheels do not rest yet by the newest answer."""
    overruled: bool = False
    """True for a resume after which somebody said stop again."""

    @property
    def complete(self) -> bool:
        """True if every robot has done as told."""
        return bool(self.done) and not (self.silent or self.moving or self.overruled)


class StopCall:
    """Stop (`stand`) or resume of the fleet, said at `now` [s] of the operator's clock."""

    def __init__(self, stand: bool, now: float) -> None:
        self._stand = stand
        self._begun = now
        self._word: StopWord | None = StopWord(1, True) if stand else None
        self._overruled = False
        self._robots: set[int] = set()
        self._named = False
        self._states: dict[int, StopState] = {}
        self._heard_at: dict[int, float] = {}
        self._say_at = now
        self._ask_at = now

    def name(self, robots: tuple[int, ...], *, all_known: bool = True) -> None:
        """Add robots that the fleet has; `all_known`: there are no others."""
        self._robots.update(robots)
        self._named = self._named or all_known

    def hear(self, robot: int, state: StopState, now: float) -> None:
        """Update with the answer of a robot's gateway."""
        known = self._states.get(robot)
        header = state.header
        if known is not None and known.header.incarnation == header.incarnation and known.header.seq >= header.seq:
            return
        self._robots.add(robot)
        self._states[robot] = state
        self._heard_at[robot] = now
        if self._word is None or state.known.word <= self._word:  # as most answers: the others are not looked at
            return
        word = max(self._believed(), default=NO_STOP)
        if word <= self._word:
            return
        if not self._stand:
            self._overruled = self._overruled or word.stand
            return
        self._word = word if word.stand else _after(word, True)
        self._say_at = now

    def asks(self, now: float) -> bool:
        """Return True if the fleet is to be asked now which robots it has."""
        if self._named or now < self._ask_at:
            return False
        self._ask_at = now + ASK_S
        return True

    def said(self, now: float) -> Said | None:
        """Return the order to publish now, or None if none is due. Raises Refused for a resume without a stop."""
        if self._word is None and (self._all_answered() or now - self._begun >= KNOWN_S):
            self._word = self._resume()
        if now < self._say_at:
            return None
        self._say_at = now + REPEAT_S
        gateways = tuple(Member(robot, state.header.incarnation) for robot, state in sorted(self._states.items()))
        return Said(self._word, gateways)

    def _resume(self) -> StopWord:
        """Return the word that lifts the newest stop heard of. Raises Refused if there is none."""
        known = [state.known for state in self._states.values()]
        if not known:
            raise Refused("resume: no gateway answers; is the fleet running?")
        newest = max(self._believed(), default=NO_STOP)
        if not newest.stand and all(one.certain and one.word == newest for one in known):
            raise Refused(f"resume: none of the {len(known)} robots that answer is stopped")
        return _after(newest, False)

    def _believed(self) -> list[StopWord]:
        """Return the words of gateways that count: a made-up epoch must not be the last one."""
        words = [state.known.word for state in self._states.values()]

        def many_tell(epoch: int) -> bool:
            tellers = sum(other.epoch >= epoch - EPOCHS_APART for other in words)
            return 2 * tellers > len(self._robots) and (tellers > 1 or self._named)

        return [word for word in words if word.epoch <= EPOCH_FREE or many_tell(word.epoch)]

    def _all_answered(self) -> bool:
        return self._named and bool(self._robots) and self._robots <= self._states.keys()

    def outcome(self, now: float) -> StopOutcome | None:
        """Return the result once it is final: all have done as told, or the time is over."""
        result = self._outcome()
        waited_s = now - self._begun
        kept = waited_s >= KEPT_S or all(self._states[robot].kept for robot in result.done)
        if result.overruled or (result.complete and kept and (self._named or waited_s >= KNOWN_S)):
            return result
        return result if waited_s >= self._patience_s(result, now) else None

    def _patience_s(self, result: StopOutcome, now: float) -> float:
        """Return for how long [s] after its beginning a stop or resume with this result is waited for."""
        if self._word is None:
            return inf
        if result.silent or not result.moving:
            return ANSWER_S
        return REST_S if all(now - self._heard_at[robot] < NEWS_S for robot in result.moving) else BRAKED_S

    def _outcome(self) -> StopOutcome:
        word = self._word or StopWord()
        obeyed = {robot for robot, state in self._states.items() if self._obeys(state, word)}
        moving = {robot for robot in obeyed if self._stand and not self._states[robot].at_rest}
        silent = tuple(sorted(self._robots - obeyed))
        return StopOutcome(word.epoch, tuple(sorted(obeyed - moving)), silent, tuple(sorted(moving)), self._overruled)

    def _obeys(self, state: StopState, word: StopWord) -> bool:
        known = state.known
        if self._stand:
            return known.word.stand and known.word >= word
        return self._word is not None and known.certain and known.word >= word and not known.word.stand


def _after(word: StopWord, stand: bool) -> StopWord:
    """Return a word of the next epoch. Raises Refused after the last one."""
    if word.epoch >= EPOCH_MAX:
        raise Refused("stop: the last epoch has been said: start the fleet anew")
    return StopWord(word.epoch + 1, stand)
