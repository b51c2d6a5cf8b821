"""The text of a trace: a line for each thing that a process says, decides or learns; renewals are counted only."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from lfa.protocol.lease.effects import AdoptChain, BecomeLeader, Effect, LeaseExtended, Send, StepDown
from lfa.protocol.lease.machine.lease import Lease
from lfa.protocol.messages.consensus import (
    NO_TERM,
    Config,
    Fence,
    Fenced,
    Grant,
    Hello,
    LeaseBody,
    Member,
    Nack,
    Prepare,
    Promise,
    Propose,
    Release,
    Term,
    Version,
)
from lfa.protocol.names import robot_name


class Trace:
    """Lines of one script's blocks. Columns: time [ms], process, what it got, what follows from it.

    Processes that get the same at the same time and do the same share their lines, by their ids; 0 is the witness.
    """

    def __init__(self) -> None:
        self._calls: list[tuple[float, list[str], str, list[str]]] = []
        """Time [s], names, cause and texts of each call."""
        self._known: dict[Member, tuple[str, int | None]] = {}
        self._said: set[object] = set()
        """What lines have shown of messages that are repeated."""
        self._repeated: Counter[tuple[Member, str]] = Counter()

    def drain(self) -> list[str]:
        """Return and clear the lines since the last call; at their end, how often leases were renewed."""
        counted = [f"{'':>9}  {_name(who):<9}  {what} {n} times" for (who, what), n in sorted(self._repeated.items())]
        lines = [line for call in self._calls for line in _lines(*call)]
        self._calls.clear()
        self._repeated.clear()
        return lines + counted

    def note(self, now: float, who: Member, text: str) -> None:
        """Write what happens to a process."""
        self._add(now, _name(who), "", [text])

    def lost(self, now: float, who: Member, to: int, body: LeaseBody) -> None:
        """Write that a message gets lost, once for each message and receiver."""
        said = (who, to, text_of(body))
        if said in self._said:
            return
        self._said.add(said)
        self._add(now, _name(who), "", [f"({text_of(body)} > {_receiver(to)} is lost)"])

    def gateway(self, now: float, robot_id: int, src: Member, answer: Fenced) -> None:
        """Write a gateway's answer to a FENCE."""
        self._add(now, f"gateway{robot_id}", f"FENCE < {robot_name(src.id)}", [text_of(answer)])

    def call(self, now: float, who: Member, lease: Lease, cause: str, effects: list[Effect]) -> None:
        """Write the effects of one call, and how role and known leader have changed by it."""
        texts = [text for effect in effects for text in self._texts(who, effect)]
        state = (lease.role.value, lease.leader)
        before = self._known.get(who, ("waiting", None))
        if state[0] != before[0]:
            texts.append(f"is {state[0]}")
        if state[1] != before[1]:
            texts.append("knows no leader" if state[1] is None else f"knows leader {state[1]}")
        self._known[who] = state
        if texts:
            self._add(now, _name(who), cause, texts)

    def _texts(self, who: Member, effect: Effect) -> Iterator[str]:
        match effect:
            case Send(to, body):
                if not self._repeats(who, to, body):
                    yield f"{text_of(body)} > {to}"
            case BecomeLeader(term, expiry):
                yield f"LEADS under {_term(term)} until {1000.0 * expiry:.1f}"
            case StepDown(term, cause):
                yield f"STOPS under {_term(term)}: {cause}"
            case AdoptChain(config):
                yield f"adopts {text_of_config(config)}"
            case LeaseExtended():
                pass

    def _repeats(self, who: Member, to: str, body: LeaseBody) -> bool:
        """Return True for a message that repeats one of an earlier line; rounds and askings are counted."""
        said: tuple[object, ...] = (who, to, type(body))
        counted = ""
        match body:
            case Propose():
                said, counted = (*said, body.term, body.config.version, body.nonce), "renews its lease"
            case Prepare():
                said, counted = (*said, body), "asks again"
            case Fence():
                said, counted = (*said, body), "fences again"
            case Grant():
                said = (*said, body.term, body.version)
            case Nack() if body.term == NO_TERM:
                said = (*said, body.config.version)
            case Nack():
                said = (*said, body.term, body.promised, body.holder, body.config.version)
            case Promise() | Hello():
                said = (*said, body)
            case _:
                return False
        repeats = said in self._said
        self._said.add(said)
        if repeats and counted:
            self._repeated[who, counted] += 1
        return repeats

    def _add(self, now: float, who: str, cause: str, texts: list[str]) -> None:
        last = self._calls[-1] if self._calls else None
        if last is not None and (last[0], last[2], last[3]) == (now, cause, texts):
            last[1].append(who)
        else:
            self._calls.append((now, [who], cause, texts))


def _lines(now: float, names: list[str], cause: str, texts: list[str]) -> Iterator[str]:
    short = [name.removeprefix("robot").replace("witness", "0").replace("gateway", "g") for name in names]
    who = names[0] if len(names) == 1 else " ".join(short)
    for n, text in enumerate(texts):
        yield f"{1000.0 * now:9.1f}  {who:<9}  {cause if n == 0 else '':<18}  {text}".rstrip()


def text_of(body: LeaseBody) -> str:
    """Return a message as text."""
    match body:
        case Prepare(term, version, forget):
            forgets = f", forgets {_members(forget)}" if forget else ""
            return f"PREPARE {_term(term)} on v{_version(version)}{forgets}"
        case Promise(term, config, needs_fence, blank):
            known = "blank" if blank else f"v{_version(config.version)}"
            fence = "" if needs_fence is None else f", fence {_term(needs_fence.term)} of {_name(needs_fence.holder)}"
            return f"PROMISE {_term(term)}, {known}{fence}"
        case Nack(term, promised, holder, remaining_s, config):
            bound = "" if holder is None else f", bound to {_name(holder)} for {1000.0 * remaining_s:.0f} ms"
            return f"NACK {_term(term)}: promised {_term(promised)}{bound}, v{_version(config.version)}"
        case Propose(term, config, round, holder, fenced, nonce):
            to = "" if nonce is None else f" to {_name(holder)}, whose lease counts from {1000.0 * nonce:.1f}"
            over = f", fenced {' '.join(map(_term, fenced))}" if fenced else ""
            return f"PROPOSE {_term(term)} round {round}{to}, v{_version(config.version)}{over}"
        case Grant(term, round, version):
            return f"GRANT {_term(term)} round {round}, v{_version(version)}"
        case Release(term):
            return f"RELEASE {_term(term)}"
        case Hello(version):
            return "HELLO, blank" if version is None else f"HELLO, v{_version(version)}"
        case Fence(old, term):
            return f"FENCE {_term(old)} below {_term(term)}"
        case Fenced(old, term):
            return f"FENCED {_term(old)} below {_term(term)}"


def text_of_config(config: Config) -> str:
    """Return a config as text: version, chain, voters (* the tie-breaker), and the electorate that must agree too."""
    previous = config.previous
    joint = "" if previous is None else f", joint with {_voters(previous.voters, previous.tie)}"
    rule = "" if previous is None or previous.rule == "half" else f" ({previous.rule})"
    chain, voters = _members(config.chain), _voters(config.voters, config.tie)
    return f"v{_version(config.version)}: chain {chain}, voters {voters}{joint}{rule}"


def _voters(voters: tuple[Member, ...], tie: Member | None) -> str:
    return " ".join(f"{_member(m)}*" if m == tie else _member(m) for m in sorted(voters))


def _members(members: tuple[Member, ...]) -> str:
    return " ".join(map(_member, members))


def _member(member: Member) -> str:
    """Return `3`, or `3/2` in its second incarnation."""
    return str(member.id) if member.incarnation == 1 else f"{member.id}/{member.incarnation}"


def _name(member: Member) -> str:
    """Return `robot3`, or `robot3/2` in its second incarnation; `witness` for id 0."""
    name = robot_name(member.id)
    return name if member.incarnation == 1 else f"{name}/{member.incarnation}"


def _receiver(to: int) -> str:
    return f"gateway{-to}" if to < 0 else robot_name(to)


def _term(term: Term) -> str:
    """Return number and issuer; the issuer's incarnation only from the second on."""
    return f"{term.n}.{_member(Member(term.issuer, max(term.incarnation, 1)))}"


def _version(version: Version) -> str:
    return f"{_term(version.term)}.{version.seq}"
