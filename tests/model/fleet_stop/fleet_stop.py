"""The fleet stop as a model: orders, gateways and agents that restart and forget (I10, and ALL; rules E28 to E30).

Each robot has a gateway and an agent; some of them restart with empty memory, a bounded number of times. Words are
numbers in their order: 0 none, then of epoch e the resume 2e - 1 and the stop 2e. Any operator may say any word of the
run at any time, so no habit of operators is relied on. What makes it small without leaving anything out:

- An order that was said can be received at any later time, once, often or never: so orders are facts, and loss, delay,
  duplication and replay need no events of their own. That an order names a gateway's incarnation is a fact as well.
- A command of an agent to this incarnation of its gateway can be received later, too (its age only forbids), while the
  gateway is not certain: to a certain one, a late command is no more than a late order.
- A gateway acknowledges a stop with the first command that shows that its agent knows it: later only forbids less.
- Wheels turn from the first command that a gateway obeyed; that the deadman stops them only forbids.

I10: after the acknowledgement of a stop that the agent keeps, no wheel turns until a greater resume is said, unless
gateway and agent have both forgotten. ALL, of a fleet that is stopped once: when all gateways and agents have known
the stop at one moment, no wheel turns until an operator says a resume after that, also of a robot that forgets
altogether, while the others do not.
"""

from __future__ import annotations

from tests.model.checker import State, Step, Successor
from tests.model.fleet_stop import stop_rules as rules

#          robot r at ROBOT r
WORD, CERTAIN, DRIVEN, NAMED, SENT, SENT_SURE, KNOWS, SURE, HEARD, KEPT_STOP = range(10)
"""Of the gateway: its word, certain, whether it has obeyed a command, words of orders that name this incarnation, words
in commands on their way from an agent that is not certain, and from one that is (masks). Of the agent: its word, sure,
the agents it has heard (mask). KEPT_STOP: the greatest stop acknowledged and not resumed; 0: none, or forgotten."""
ROBOT = 10

MUTANTS = {
    "stop_not_held": "a gateway does not hold a stop",
    "replayed_believed": "late and replayed words of a stop are believed",
    "resume_wins_tie": "of one epoch the resume wins over the stop",
    "starts_certain": "a gateway that starts may go",
    "any_resume": "any resume lets a gateway go that has just started",
    "agent_sure": "an agent that starts knows what holds",
    "command_first": "a gateway obeys a command before it has read the stop in it",
}
WORD_NAMES = ("no word", "resume 1", "stop 1", "resume 2", "stop 2")
LIFTED = 255


class FleetStop:
    def __init__(
        self, robots: int, words: tuple[int, ...], gateways: int, agents: int, mutant: str = "", restarting: int = 1
    ) -> None:
        """`words` that operators may say. The first `restarting` robots' gateways and agents restart, so often in all.

        ALL is checked if only one of several may forget, and there is one stop.
        """
        assert mutant in ("", *MUTANTS), mutant
        self.robots, self.words, self.mutant = tuple(range(robots)), words, mutant
        self.columns = (*(f"robot {r + 1} and its gateway" for r in self.robots), "operators")
        self.restarts, self.restarting = (gateways, agents), self.robots[:restarting]
        self.all_holds = robots > 1 and restarting == 1 and sum(map(rules.stands, words)) == 1
        self.said = ROBOT * robots
        self.left = self.said + 1
        self.complete = self.left + 2

    def initial(self) -> State:
        """A fleet that nobody has stopped: everybody is certain, and drives."""
        s = bytearray(self.complete + 1)
        for r in self.robots:
            at = ROBOT * r
            s[at + CERTAIN] = s[at + DRIVEN] = s[at + SURE] = 1
        s[self.left], s[self.left + 1] = self.restarts
        return bytes(s)

    def successors(self, s: State) -> list[Successor]:
        out: list[Successor] = []
        for word in self.words:
            if not s[self.said] >> word & 1:
                b = bytearray(s)
                b[self.said] |= 1 << word
                self._lift(b, word)
                self._reached(b, out, len(self.robots), "says %s", WORD_NAMES[word])
        for r in self.robots:
            self._order(s, r, out)
            self._command(s, r, out)
            self._learn(s, r, out)
            if r in self.restarting:
                self._restart(s, r, out)
        return out

    def step(self, event: tuple[object, ...]) -> Step:
        column, text = event[0], event[1]
        assert isinstance(column, int) and isinstance(text, str)
        return Step(column, text % event[2:] if len(event) > 2 else text)

    # --- what happens --------------------------------------------------------------------------------------------

    def _order(self, s: State, r: int, out: list[Successor]) -> None:
        """An order is received by the gateway or the agent of robot r; its operator hears of a gateway and names it."""
        at = ROBOT * r
        for word in self.words:
            if not s[self.said] >> word & 1:
                continue
            name, named = WORD_NAMES[word], s[at + NAMED] >> word & 1
            if not s[at + CERTAIN] and not named and word >= s[at + WORD]:
                b = bytearray(s)
                b[at + NAMED] |= 1 << word
                self._lift(b, word)
                self._reached(b, out, len(self.robots), "%s again, names gateway %d", name, r + 1)
            for is_named in (False, True) if named else (False,):
                b = bytearray(s)
                b[at + WORD], b[at + CERTAIN] = self._ordered(s[at + WORD], s[at + CERTAIN], word, is_named)
                self._reached(b, out, r, "gateway hears %s%s", name, ", named in it" if is_named else "")
            b = bytearray(s)
            b[at + KNOWS] = max(s[at + KNOWS], word)
            self._reached(b, out, r, "agent hears %s", name)

    def _ordered(self, known: int, certain: int, word: int, named: bool) -> tuple[int, int]:
        if self.mutant == "replayed_believed":
            return word, certain
        if self.mutant == "resume_wins_tie" and known == word + 1 and rules.stands(known):
            return word, certain
        return rules.ordered(known, bool(certain), word, named or self.mutant == "any_resume")

    def _command(self, s: State, r: int, out: list[Successor]) -> None:
        """The agent of robot r sends a command, which arrives at once or later; or one on its way arrives."""
        at = ROBOT * r
        word, sent = s[at + KNOWS], SENT + s[at + SURE]
        self._arrive(s, r, word, s[at + SURE], out)
        if not s[at + CERTAIN] and not s[at + sent] >> word & 1:
            b = bytearray(s)
            b[at + sent] |= 1 << word
            self._reached(b, out, r, "agent commands (%s), on its way", WORD_NAMES[word])
        for sure in (0, 1):
            for word in range(len(WORD_NAMES)):
                if s[at + SENT + sure] >> word & 1:
                    self._arrive(s, r, word, sure, out)

    def _arrive(self, s: State, r: int, word: int, sure: int, out: list[Successor]) -> None:
        b, at = bytearray(s), ROBOT * r
        reads_first = self.mutant != "command_first" or s[at + DRIVEN]
        b[at + DRIVEN] = 1
        if reads_first:
            b[at + WORD], b[at + CERTAIN] = rules.told(s[at + WORD], bool(s[at + CERTAIN]), word, bool(sure))
            self._acknowledge(b, at, word)
        self._reached(b, out, r, "gateway obeys a command (%s)", WORD_NAMES[word])

    def _learn(self, s: State, r: int, out: list[Successor]) -> None:
        """The agent of robot r reads its gateway's state, or an answer of another agent while it is not certain."""
        at = ROBOT * r
        b = bytearray(s)
        b[at + KNOWS], b[at + SURE] = max(s[at + KNOWS], s[at + WORD]), s[at + SURE] | s[at + CERTAIN]
        self._reached(b, out, r, "agent reads its gateway")
        if s[at + SURE]:
            return
        for other in self.robots:
            if other != r:
                b = bytearray(s)
                b[at + KNOWS] = max(s[at + KNOWS], s[ROBOT * other + KNOWS])
                b[at + HEARD] |= 1 << other
                b[at + SURE] = rules.enough(b[at + HEARD], len(self.robots))
                self._reached(b, out, r, "agent hears agent %d", other + 1)

    def _restart(self, s: State, r: int, out: list[Successor]) -> None:
        """Gateway or agent of robot r start with empty memory; what both have forgotten is held against nobody."""
        at = ROBOT * r
        if s[self.left]:
            b = bytearray(s)
            b[self.left] -= 1
            b[at : at + KNOWS] = bytes(KNOWS)
            b[at + CERTAIN] = self.mutant == "starts_certain"
            if s[at + KNOWS] < s[at + KEPT_STOP]:
                b[at + KEPT_STOP] = 0
            self._reached(b, out, r, "gateway restarts")
        if s[self.left + 1]:
            b = bytearray(s)
            b[self.left + 1] -= 1
            b[at + KNOWS], b[at + HEARD] = 0, 1 << r
            b[at + SURE] = rules.enough(1 << r, len(self.robots)) or self.mutant == "agent_sure"
            if not s[at + CERTAIN] or s[at + WORD] < s[at + KEPT_STOP]:
                b[at + KEPT_STOP] = 0
            self._reached(b, out, r, "agent restarts")

    def _acknowledge(self, b: bytearray, at: int, agent_word: int) -> None:
        if rules.stands(b[at + WORD]) and agent_word >= b[at + WORD]:
            b[at + KEPT_STOP] = max(b[at + KEPT_STOP], b[at + WORD])

    def _lift(self, b: bytearray, word: int) -> None:
        """Whoever says a resume, for the first time or again, ends what ALL demands."""
        if b[self.complete] and not rules.stands(word):
            b[self.complete] = LIFTED

    # --- states --------------------------------------------------------------------------------------------------

    def _reached(self, b: bytearray, out: list[Successor], column: int, *text: object) -> None:
        """Drop what changes nothing any more, and add the state with what it breaks."""
        resumes = max((w for w in self.words if b[self.said] >> w & 1 and not rules.stands(w)), default=0)
        wrong, everybody = None, LIFTED
        for r in self.robots:
            at = ROBOT * r
            word, certain = b[at + WORD], b[at + CERTAIN]
            if b[at + SURE]:
                b[at + HEARD] = 0
            if certain:
                b[at + NAMED] = b[at + SENT] = b[at + SENT_SURE] = 0
            elif b[at + DRIVEN]:
                b[at + SENT] &= -2 << word  # a command that tells no more than is known
            b[at + NAMED] &= -1 << word
            if b[at + KEPT_STOP] < resumes:
                b[at + KEPT_STOP] = 0
            if b[at + DRIVEN] and certain and (not rules.stands(word) or self.mutant == "stop_not_held"):
                if b[at + KEPT_STOP]:
                    wrong = f"I10: robot {r + 1} drives after it acknowledged {WORD_NAMES[b[at + KEPT_STOP]]}"
                elif b[self.complete] not in (0, LIFTED) and self.all_holds:
                    wrong = f"ALL: robot {r + 1} drives after all acknowledged {WORD_NAMES[b[self.complete]]}"
            everybody = min(everybody, b[at + KEPT_STOP], word, b[at + KNOWS])
        if b[self.complete] != LIFTED and rules.stands(everybody):
            b[self.complete] = max(b[self.complete], everybody)
        out.append(((column, *text), bytes(b), wrong))
