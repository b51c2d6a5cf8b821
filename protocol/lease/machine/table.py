"""The lease protocol of one process as a table: what happens in which state, and what is done then.

The problem. Robots must agree on one leader although messages get lost and late, processes die, pause and restart, and
nobody can tell a dead process from a silent one. A leader that believes too long that it leads would do harm.

The answer is a lease. A leader leads for a short time only, `T_act`, and only because a *quorum* of *voters* has bound
itself to it for longer, `T_grant`: any two quorums share a voter, and no voter is bound to two, so while one lease
lasts no other begins. No clock is compared with another. The holder counts from before it asked, the voter from when
it was asked, so a late message makes a lease shorter and never longer (E2). A leader that cannot renew stops by its own
clock (E7), and the gateways at the wheels refuse commands that are old or of an older term (E11, E12).

One round. The leader sends PROPOSE once a heartbeat, each voter answers GRANT, and a quorum's grants extend the lease.
PROPOSE carries the *config* as well: the voters and the chain, written by the leader. A voter that says no says NACK,
with the term that it has promised, the bond that it is under, and the newest config that it knows.

One election. A follower whose bond has ended stands, the next in the chain first (E6). Phase 1: it sends PREPARE under
a *term* above all that it has heard of; voters that are free promise to accept nothing lower, and tell their config. A
voter that is still bound, but whose holder's token has vanished, promises too and names the lease: before going on,
the candidate has that holder's gateway fenced (E15). Phase 2: it writes the config that it leads and sends PROPOSE as a
leader does; the quorum's grants make it the leader.

One agreement. All this is safe only if all hold the same durations, the same members and the same policies. PREPARE,
PROPOSE and HELLO carry a digest of them; a process that holds something else is refused, and ends if outvoted (E25).

One end. A leader steps down first and tells later: it stops commanding, has its own gateway refuse its term, and only
then sends RELEASE, which frees the voters at once (E4). To hand over, it sends instead of RELEASE a PROPOSE that names
its successor, which only counts the grants (E16).

A raised term. A leader that is refused for a higher promise, or whose gateway knows a higher term, asks for a higher
term of its own as a candidate does, and goes on leading under the old one until it is granted (E10).

So the state of a process is what it holds: a candidacy, a lease, both, or neither.

`TRANSITIONS` is the whole machine: `Lease` looks up the event and the state here and calls the action; an event without
a row for the state does nothing. `python -m tests.protocol.lease.page` writes the table to protocol/README.md.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum
from typing import NamedTuple

from lfa.protocol.lease.machine import agreeing, candidacy, leadership, resigning, voting
from lfa.protocol.lease.machine.memory import LeaseMemory
from lfa.protocol.messages.consensus import Nack


class LeaseState(StrEnum):
    """What a process holds. The voter answers alike in all states."""

    FOLLOWER = "follower"
    STEPPING_DOWN = "stepping down"
    CANDIDATE = "candidate"
    FENCING = "fencing"
    PROPOSING = "proposing"
    TAKING_OVER = "taking over"
    LEADER = "leader"
    RAISING = "raising"
    SWITCHING = "switching"

    __hash__ = str.__hash__  # an enum's own is a Python function, and the table is read at every message


MEANING: dict[LeaseState, str] = {
    LeaseState.FOLLOWER: "neither lease nor candidacy: waits for its turn to stand",
    LeaseState.STEPPING_DOWN: "a follower that led: its gateway has still to refuse the old term",
    LeaseState.CANDIDATE: "phase 1: asks for promises",
    LeaseState.FENCING: "phase 1: enough have promised; waits for the gateways of the holders that they are bound to",
    LeaseState.PROPOSING: "phase 2: asks for the first grants",
    LeaseState.TAKING_OVER: "phase 2 of a term that was handed over: counts the grants that its issuer asked for",
    LeaseState.LEADER: "holds a lease",
    LeaseState.RAISING: "a leader that asks for promises to a higher term of its own",
    LeaseState.SWITCHING: "a leader that asks for the grants of its higher term",
}


class LeaseEvent(StrEnum):
    """What happens to a process: a message, a word of its agent or operator, or a deadline."""

    PREPARE = "PREPARE"
    PROMISE = "PROMISE"
    PROPOSE = "PROPOSE"
    GRANT = "GRANT"
    NACK_HIGHER = "NACK: higher promise"
    NACK_NEWER = "NACK: newer config"
    NACK_BOTH = "NACK: higher promise, newer config"
    NACK_BOUND = "NACK: bound"
    NACK_FOREIGN = "NACK: another agreement"
    FOREIGN = "PREPARE, PROPOSE or HELLO of another agreement"
    RELEASE = "RELEASE"
    HELLO = "HELLO"
    SUPERSEDED = "SUPERSEDED"
    FENCED = "FENCED"
    TOKEN_VANISHED = "token vanished"
    GATEWAY_BARS = "gateway bars the term"
    LEAVE = "asked to leave"
    HAND_OVER = "asked to hand over"
    FORGET = "asked to forget the dead"
    ROSTER = "asked to change the roster"
    LEASE_EXPIRED = "lease expired"
    RELEASE_DUE = "last command too old"
    CONFIG_DUE = "config due"
    ROUND_DUE = "round due"
    ELECTION_DUE = "turn to stand"
    ATTEMPT_OVER = "attempt over"
    GRANTS_DUE = "PROPOSE due"
    FORGET_OVER = "declaration void"
    PROMISES_DUE = "PREPARE due"
    HELLO_DUE = "HELLO due"
    LEADER_LOST = "leader's lease over"

    __hash__ = str.__hash__


Action = Callable[..., object]


class Transition(NamedTuple):
    """One row: in each of `states`, `event` causes `action`; afterwards the process is in `to` or as before."""

    event: LeaseEvent
    states: tuple[LeaseState, ...]
    action: Action
    to: tuple[LeaseState, ...]
    rules: str
    text: str


def state_of(m: LeaseMemory) -> LeaseState:
    """Return the state: it follows from what is held, so no second variable can disagree."""
    candidate, leads = m.candidate, m.holder is not None
    if candidate is None:
        if leads:
            return LeaseState.LEADER
        return LeaseState.FOLLOWER if m.pending_release.unreleased is None else LeaseState.STEPPING_DOWN
    if candidate.holder is not None:
        if candidate.transferred:
            return LeaseState.TAKING_OVER
        return LeaseState.SWITCHING if leads else LeaseState.PROPOSING
    if leads:
        return LeaseState.RAISING
    return LeaseState.FENCING if candidate.fencing else LeaseState.CANDIDATE


def refusal(m: LeaseMemory, body: Nack) -> LeaseEvent | None:
    """Return which refusal a NACK is for what this process asked; None if it says nothing to act upon."""
    candidate, own = m.candidate, None
    if candidate is not None:
        # Every refusal names the promised term: repeating the request under a lower term is useless.
        in_vain = candidate.holder is None and body.promised > candidate.term
        if body.term != candidate.term and not in_vain:
            return None
        own = candidate.term
    elif m.holder is not None:
        own = m.holder.term
        if body.term != own:
            return None
    newer = body.config.version > m.config.version
    if own is not None and body.promised > own:
        return LeaseEvent.NACK_BOTH if newer else LeaseEvent.NACK_HIGHER
    if newer:
        return LeaseEvent.NACK_NEWER
    return LeaseEvent.NACK_BOUND if body.remaining_s > 0.0 else None


E, S = LeaseEvent, LeaseState
ALL = tuple(LeaseState)
RESTING = (S.FOLLOWER, S.STEPPING_DOWN)
PHASE_1 = (S.CANDIDATE, S.FENCING, S.RAISING)
PHASE_2 = (S.PROPOSING, S.TAKING_OVER, S.SWITCHING)
LEADS = (S.LEADER, S.RAISING, S.SWITCHING)
LEADS_NOT = tuple(state for state in LeaseState if state not in LEADS)

UP = (S.RAISING, S.SWITCHING)
"""Where a leader gets that has to raise its term."""
DROPPED = (*RESTING, S.LEADER)
"""Where a process gets that gives up its candidacy."""
ON = (S.CANDIDATE, S.FENCING, S.PROPOSING, S.SWITCHING, *DROPPED)
"""Where a candidacy gets that may go on: to the next phase, to the lease, or nowhere."""

# fmt: off
TRANSITIONS = (
    Transition(E.PREPARE, ALL, voting.on_prepare, DROPPED, "E1 E3 E5 E15 E20",
               "promise, refuse or stay silent; a promise to a higher term ends the own candidacy"),
    Transition(E.PROMISE, PHASE_1, candidacy.on_promise, ON, "E15 E18-E21",
               "count it; with a quorum, fence the leases that it names, then PROPOSE"),
    Transition(E.FENCED, PHASE_1, candidacy.on_fenced, ON, "E4 E15",
               "count it; PROPOSE when all have confirmed"),
    Transition(E.FENCED, (*RESTING, *PHASE_2, S.LEADER), resigning.on_fenced, (S.FOLLOWER,), "E4 E16",
               "if it is the own gateway's: RELEASE, or the transfer proposal"),
    Transition(E.PROPOSE, ALL, voting.on_propose, (*DROPPED, S.TAKING_OVER), "E2 E3 E16 E24",
               "grant or refuse; adopt its config and follow its holder, or be that holder"),
    Transition(E.GRANT, (*RESTING, S.CANDIDATE, S.FENCING), voting.keep_grant, (), "E16",
               "keep it if its term is unknown"),
    Transition(E.GRANT, (*PHASE_2, S.LEADER, S.RAISING), leadership.on_grant, (S.LEADER, *UP), "E2 E17",
               "count it; a quorum's make the leader, or extend its lease and settle a joint config"),
    Transition(E.NACK_HIGHER, PHASE_1, candidacy.give_up, DROPPED, "E6",
               "give up, stand again later under a higher term"),
    Transition(E.NACK_HIGHER, PHASE_2, candidacy.give_up_without_quorum, DROPPED, "E6",
               "give up if no quorum is left"),
    Transition(E.NACK_HIGHER, (S.LEADER,), candidacy.raise_term, UP, "E10",
               "raise the term"),
    Transition(E.NACK_BOTH, (*PHASE_1, *PHASE_2), candidacy.give_up, DROPPED, "E6",
               "adopt the config, give up"),
    Transition(E.NACK_BOTH, (S.LEADER,), candidacy.raise_term, (S.STEPPING_DOWN, *UP), "E10",
               "adopt the config; raise the term if it still leads"),
    Transition(E.NACK_NEWER, PHASE_1, candidacy.ask_again, ON, "E6",
               "adopt the config, PREPARE again at once"),
    Transition(E.NACK_NEWER, PHASE_2, candidacy.give_up, DROPPED, "E6",
               "adopt the config, give up"),
    Transition(E.NACK_NEWER, (S.LEADER,), candidacy.adopt_refusal, (S.STEPPING_DOWN,), "E9",
               "adopt the config, and stop if another leads it"),
    Transition(E.NACK_NEWER, RESTING, candidacy.follow_refusal, (), "E9",
               "adopt the config, give its holder time"),
    Transition(E.NACK_BOUND, PHASE_1, candidacy.wait_for_bond, (), "E3",
               "PREPARE again when the bond ends"),
    Transition(E.FOREIGN, ALL, agreeing.refuse_foreign, (), "E25",
               "NACK with the own agreement; nothing else in it counts"),
    Transition(E.NACK_FOREIGN, ALL, agreeing.refused_as_foreign, (), "E25",
               "count it; without a leader, end if outvoted"),
    Transition(E.RELEASE, ALL, voting.on_release, DROPPED, "E4",
               "end a bond of this term and start the election; answer the PREPARE that the bond refused"),
    Transition(E.HELLO, LEADS_NOT, voting.answer_hello, (), "E9 E23",
               "without a leader, answer with the newest config, if it knows one or is of the first ids; tell an "
               "earlier incarnation so"),
    Transition(E.HELLO, (S.LEADER,), leadership.on_hello, UP, "E9 E22 E23",
               "take the sender into the chain"),
    Transition(E.HELLO, UP, leadership.note_hello, (), "E9 E23",
               "note the sender"),
    Transition(E.SUPERSEDED, ALL, voting.on_superseded, (), "E23",
               "note it, to start anew under a later number"),
    Transition(E.TOKEN_VANISHED, (S.LEADER,), leadership.reshape, UP, "E8",
               "close the chain over it"),
    Transition(E.TOKEN_VANISHED, RESTING, voting.holder_vanished, (), "E15",
               "if it is the holder's: start the election, answer the PREPARE that the bond refused"),
    Transition(E.GATEWAY_BARS, (S.LEADER,), candidacy.stand, UP, "E10",
               "raise the term"),
    Transition(E.LEAVE, ALL, resigning.leave, RESTING, "E4",
               "stop, fence the own gateway, stand never again"),
    Transition(E.HAND_OVER, LEADS, resigning.hand_over, (S.STEPPING_DOWN,), "E16",
               "stop, fence the own gateway, then name the next in the chain that answers"),
    Transition(E.FORGET, LEADS_NOT, candidacy.forget, RESTING, "E20",
               "without a leader, stand at once, and need no vote of the dead"),
    Transition(E.ROSTER, (S.LEADER,), leadership.change_roster, UP, "E33 E34",
               "write and PROPOSE it, with chain and voters by it"),
    Transition(E.LEASE_EXPIRED, LEADS, resigning.expire, (*RESTING, S.CANDIDATE, S.FENCING, S.PROPOSING), "E7",
               "stop, fence the own gateway, stay silent for `T_grant`"),
    Transition(E.RELEASE_DUE, ALL, resigning.complete, (S.FOLLOWER,), "E4 E16",
               "RELEASE, or the transfer proposal, though the own gateway did not answer"),
    Transition(E.CONFIG_DUE, (S.LEADER,), leadership.reshape, UP, "E8 E17",
               "write and PROPOSE the next config if chain or voters change"),
    Transition(E.ROUND_DUE, (S.LEADER,), leadership.renew, UP, "E2 E10",
               "PROPOSE; raise the term if the own voter refuses"),
    Transition(E.ELECTION_DUE, RESTING, candidacy.stand, ON, "E6",
               "stand under a term above all known ones, unless bound"),
    Transition(E.ATTEMPT_OVER, PHASE_2, candidacy.give_up_late, DROPPED, "E2",
               "give up: the first grants have expired"),
    Transition(E.GRANTS_DUE, (S.PROPOSING, S.SWITCHING), candidacy.ask_grants, DROPPED, "E2",
               "PROPOSE again"),
    Transition(E.FORGET_OVER, PHASE_1, candidacy.forget_over, DROPPED, "E20",
               "give up an attempt without the votes of the dead"),
    Transition(E.PROMISES_DUE, PHASE_1, candidacy.ask_promises, ON, "E6",
               "PREPARE again under the same term"),
    Transition(E.HELLO_DUE, ALL, voting.say_hello, (), "E9",
               "HELLO, if bound to nobody or in no chain"),
    Transition(E.LEADER_LOST, LEADS_NOT, voting.lose_leader, (), "E7",
               "know of no leader"),
)
"""In each state an event causes at most one action."""
# fmt: on

ACTIONS: dict[tuple[LeaseEvent, LeaseState], Action] = {
    (row.event, state): row.action for row in TRANSITIONS for state in row.states
}
