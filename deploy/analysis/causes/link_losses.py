"""Links of a run that were cut or lost messages: those that the recorder heard, and the receiver's journal lacks.

Pure functions of a `RunTrace`.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Mapping, Sequence, Set

from msgspec import Struct

from lfa.deploy.analysis.causes.fact import Fact, called, listed
from lfa.deploy.analysis.causes.run_trace import STALL_S, Number, ProcessTrace, RunTrace, SentMessage
from lfa.protocol.names import WITNESS_NAME
from lfa.protocol.topics import WORLD_NAME

CUT_S, CUT_MESSAGES = 0.25, 6
"""Least duration [s] and number of messages in a row, all lost, of a cut link."""
CHANCE_MAX = 1e-5
"""Probability below which such a row is no chance, at the share that the other links lose meanwhile."""
LOSS_S = 1.0
"""Length [s] of the intervals over which the loss of a link is counted."""
LOSS_MIN, LOSS_MESSAGES = 0.04, 2
"""Least share and number of messages lost on all links in an interval that counts as loss."""
TOGETHER_S = 2.0
"""Time [s] within which cuts of several links belong together: some links carry a message every half second."""
SHOWN_MAX = 3


class _Delivery(Struct, frozen=True, gc=False):
    """One message on one link: when it was sent, and whether the receiver's journal has it."""

    at_s: float
    arrived: bool
    number: str


def losses(trace: RunTrace) -> list[Fact]:
    """Return the cuts of single links, and the intervals in which messages were lost beyond those."""
    links = {
        (sender[0], receiver.name, sender[1], receiver.incarnation): _deliveries(sender, messages, receiver)
        for receiver in trace.processes
        if receiver.name != WORLD_NAME
        for sender, messages in trace.sent.items()
        if sender[0] != receiver.name
    }
    rows = {link: _lost_rows(deliveries) for link, deliveries in links.items()}
    cuts: list[Fact] = []
    others: list[tuple[str, str, _Delivery]] = []
    for link, deliveries in links.items():
        lost = [row for row in rows[link] if _probability(row, links, rows) < CHANCE_MAX]
        cuts += [_cut(f"{link[0]}>{link[1]}", row, deliveries) for row in lost]
        in_cuts = {one for row in lost for one in row}
        others += [(link[0], link[1], one) for one in deliveries if one not in in_cuts]
    return [*_joined(cuts), *_lossy(others, trace.end_s)]


def _deliveries(sender: tuple[str, int], messages: Sequence[SentMessage], receiver: ProcessTrace) -> list[_Delivery]:
    """Return the messages that `receiver` should have got: sent to it or all, while it ran and did not stand still."""
    got: Set[Number] = receiver.received.get(sender, frozenset())
    found = []
    for message in messages:
        if message.to not in ("", receiver.name) or not _listens(receiver, message.at_s):
            continue
        if message.number[0] == "table" and receiver.name == WITNESS_NAME:
            continue
        topic, seq = message.number
        found.append(_Delivery(message.at_s, message.number in got, f"{topic} {seq}"))
    return found


def _listens(receiver: ProcessTrace, at_s: float) -> bool:
    """Return True if the process ran at `at_s` [s] and ticked soon after."""
    if not receiver.first_s + STALL_S < at_s < receiver.last_s - 0.05:
        return False
    if receiver.name == WITNESS_NAME:
        return True
    n = bisect_left(receiver.ticks_s, at_s)
    return 0 < n < len(receiver.ticks_s) and receiver.ticks_s[n] - receiver.ticks_s[n - 1] < STALL_S


_Link = tuple[str, str, int, int]
"""Sender, receiver, and their incarnations."""


def _lost_rows(deliveries: Sequence[_Delivery]) -> list[list[_Delivery]]:
    """Return the rows of messages, all lost, that are long enough for a cut."""
    rows: list[list[_Delivery]] = [[]]
    for one in deliveries:
        if one.arrived:
            rows.append([])
        else:
            rows[-1].append(one)
    return [row for row in rows if len(row) >= CUT_MESSAGES and row[-1].at_s - row[0].at_s >= CUT_S]


def _probability(
    row: Sequence[_Delivery],
    links: Mapping[_Link, Sequence[_Delivery]],
    rows: Mapping[_Link, Sequence[Sequence[_Delivery]]],
) -> float:
    """Return the probability of a lost row, at the share of messages that links without such a row lost meanwhile."""
    from_s, until_s = row[0].at_s, row[-1].at_s
    sent = lost = 0
    for link, deliveries in links.items():
        if any(other[0].at_s <= until_s and other[-1].at_s >= from_s for other in rows[link]):
            continue
        meanwhile = [one for one in deliveries if from_s <= one.at_s <= until_s]
        sent += len(meanwhile)
        lost += sum(not one.arrived for one in meanwhile)
    return float(((lost + 0.5) / (sent + 1.0)) ** len(row)) if sent else 0.0


def _cut(link: str, row: Sequence[_Delivery], deliveries: Sequence[_Delivery]) -> Fact:
    """Return the fact that the messages of `row` were lost on a link that was cut; it ends with the next arrival."""
    sender, _, receiver = link.partition(">")
    until_s = next((one.at_s for one in deliveries if one.at_s > row[-1].at_s and one.arrived), None)
    text = f"nothing from {called(sender)} reached {called(receiver)}"
    proof = f"{row[0].number} to {row[-1].number}: {len(row)} messages sent, none received"
    return Fact(row[0].at_s, "cut", link, text, until_s, evidence=proof)


def _joined(cuts: Sequence[Fact]) -> list[Fact]:
    """Return the cuts; those that begin together at one process become one fact that names it as `other`."""
    found: list[Fact] = []
    left = sorted(cuts, key=lambda fact: fact.at_s)
    while left:
        together = [fact for fact in left if fact.at_s - left[0].at_s < TOGETHER_S]
        names = sorted({name for fact in together for name in fact.places})
        centre = max(names, key=lambda name: sum(name in fact.places for fact in together))
        of_it = [fact for fact in together if centre in fact.places]
        rest = sorted({name for fact in of_it for name in fact.places} - {centre})
        if len(rest) == 1:
            of_it = [left[0]]
        found.append(of_it[0] if len(rest) == 1 else _of_one_place(centre, rest, of_it))
        left = [fact for fact in left if fact not in of_it]
    return found


def _of_one_place(centre: str, others: Sequence[str], cuts: Sequence[Fact]) -> Fact:
    """Return the cut of a process from several others, as one fact."""
    sends = {fact.place.partition(">")[0] == centre for fact in cuts}
    ends = listed(others)
    if len(sends) == 2:
        text = f"nothing came through between {called(centre)} and {ends}"
    elif True in sends:
        text = f"nothing from {called(centre)} reached {ends}"
    else:
        text = f"nothing from {ends} reached {called(centre)}"
    ends_s = [fact.until_s for fact in cuts if fact.until_s is not None]
    until_s = max(ends_s) if len(ends_s) == len(cuts) else None
    return Fact(cuts[0].at_s, "cut", ">".join([centre, *others]), text, until_s, centre, cuts[0].evidence)


def _lossy(deliveries: Sequence[tuple[str, str, _Delivery]], end_s: float) -> list[Fact]:
    """Return the intervals in which at least `LOSS_MIN` of all messages were lost, neighbours joined."""
    bins: dict[int, list[tuple[str, str, _Delivery]]] = {}
    for one in deliveries:
        bins.setdefault(int(one[2].at_s / LOSS_S), []).append(one)
    bad = []
    for number, some in sorted(bins.items()):
        lost = [one for one in some if not one[2].arrived]
        if len(lost) >= LOSS_MESSAGES and len(lost) >= LOSS_MIN * len(some):
            bad.append((number, lost, len(some)))
    found: list[Fact] = []
    while bad:
        run = [bad.pop(0)]
        while bad and bad[0][0] - run[-1][0] <= 2:
            run.append(bad.pop(0))
        lost, sent = [one for _, some, _ in run for one in some], sum(count for *_, count in run)
        links = {(sender, receiver) for sender, receiver, _ in lost}
        from_s, until_s = min(one.at_s for *_, one in lost), max(one.at_s for *_, one in lost)
        names = sorted({name for link in links for name in link})
        text = (
            f"{round(100.0 * len(lost) / sent)} % of the messages were lost, on {len(links)} links of {listed(names)}"
        )
        proof = ", ".join(f"{one.number} {sender}>{receiver}" for sender, receiver, one in lost[:SHOWN_MAX])
        lasting = until_s if until_s < end_s - LOSS_S else None
        found.append(Fact(from_s, "lossy", ">".join(names), text, lasting, evidence=f"among the lost: {proof}"))
    return found
