"""Link model (delay, loss, duplication, order, cuts) for the simulations and, at a receiver, for the live bus.

A link connects two places: robots, or the world (with the witness); a robot's gateway and sensors are on the robot. A
cut affects one link in one direction, so partial and asymmetric partitions are sets of cuts. Liveliness tokens are not
messages and are not affected.
"""

from __future__ import annotations

import heapq
from collections.abc import Mapping
from math import dist
from random import Random
from typing import Any

import msgspec
from msgspec import Struct, structs

from lfa.protocol.messages.robot import Localization
from lfa.protocol.messages.team import PoseStamped, TableRow
from lfa.protocol.names import WITNESS_NAME
from lfa.protocol.topics import OPERATOR_NAME, RECORDER_NAME, TRUTH_OWNER, WORLD_NAME, address, message_in
from lfa.protocol.transport.bus import Arrival

Link = tuple[str, str]
"""Directed link: sending place, receiving place."""
LINK_CONDITIONS = "weather"
"""Operator command that sets link conditions; its arguments are those of `LinkModel.obey`."""
WAITING_MAX = 4096
"""Maximum number of delayed messages at a live receiver."""
_PLACED = frozenset({"localization", "pose", "table"})
"""Topics from which a live receiver knows where its own robot and its senders are."""
_ON_NO_LINK = (OPERATOR_NAME, RECORDER_NAME, TRUTH_OWNER)


class Radio(Struct, frozen=True, forbid_unknown_fields=True):
    """Link conditions between processes of different robots."""

    delay_s: float = 0.0005
    jitter_s: float = 0.001
    """Upper bound [s] of a uniform random delay added to `delay_s`."""
    loss: float = 0.0
    """Probability that one message to one receiver is lost."""
    loss_burst: float = 1.0
    """Mean number of consecutive losses, if above that of independent losses (Gilbert's two-state channel)."""
    duplication: float = 0.0
    """Probability that a message arrives twice; each copy has its own delay."""
    duplication_lag_s: float = 0.0
    """Upper bound [s] of a uniform random delay added to the second copy."""
    tail: float = 0.0
    """Probability of an additional exponential delay of mean `tail_mean_s`."""
    tail_mean_s: float = 0.05
    """Mean [s] of the additional delay."""
    reorder: float = 0.0
    """Probability that a message is held back for up to 0.15 s, so that later ones overtake it."""
    range_m: float = 0.0
    """Distance [m] up to which robots hear each other, 0: any. Where robots are processes the fault `range` sets it."""

    @property
    def prompt_s(self) -> float:
        """Longest delay [s] of a message that neither the tail nor a reordering holds back."""
        return self.delay_s + self.jitter_s


REORDER_S = 0.15
"""Maximum delay [s] of a message held back; more than three heartbeats of the profile std."""
CLEAR = Radio(delay_s=0.0, jitter_s=0.0)
"""Link conditions that add nothing to those of the live bus."""


def link_of(key: str, receiver: str) -> Link | None:
    """Return the link that a message on `key` crosses to the process `receiver`; None if it crosses none.

    A robot and its own hardware share a place; operator, recorder and ground truth never cross a link.
    """
    sender, place = ends_of(key)
    place = place_of(receiver) if place is None else place
    return None if sender is None or sender == place else (sender, place)


def ends_of(key: str) -> tuple[str | None, str | None]:
    """Return the place that a message on `key` is sent from, and the one at which all hear it.

    The first is None if it crosses no link, the second if each receiver hears it at its own place.
    """
    where = address(key)
    if where is None or where.topic == "alive" or where.owner in _ON_NO_LINK:
        return None, None
    sender = place_of(where.owner)
    if where.to is not None and where.to.startswith("gateway"):
        return sender, where.to.replace("gateway", "robot")
    return sender, sender if where.topic == "cmd_vel" else None


def _links(pairs: tuple[Link, ...]) -> frozenset[Link]:
    return frozenset((place_of(sender), place_of(receiver)) for sender, receiver in pairs)


def place_of(name: str) -> str:
    """Return the place of a process: the witness runs where the world does."""
    return WORLD_NAME if name == WITNESS_NAME else name


class LinkModel:
    """Link conditions with their state; randomness comes from a seeded generator."""

    def __init__(self, radio: Radio, random: Random) -> None:
        self.radio = radio
        self.cuts: frozenset[Link] = frozenset()
        self._fair = radio
        self._random = random
        self._fading: dict[tuple[str, str], bool] = {}
        self.places: dict[str, tuple[float, float]] = {}
        """Positions x, y [m] of the robots, where they are known: only then the range has an effect."""

    def delays(self, sender: str, receiver: str) -> list[float]:
        """Return the delays [s] of a message from `sender` to `receiver`: empty if lost, two if duplicated."""
        radio = self.radio
        if (sender, receiver) in self.cuts or (radio.range_m > 0.0 and self._out_of_range(sender, receiver)):
            return []
        if radio.loss > 0.0 and self._lost(sender, receiver):
            return []
        if radio.duplication == radio.tail == radio.reorder == 0.0:
            return [radio.delay_s + radio.jitter_s * self._random.random()]
        delays = [self._delay_s()]
        if radio.duplication > 0.0 and self._random.random() < radio.duplication:
            lag_s = radio.duplication_lag_s * self._random.random() if radio.duplication_lag_s > 0.0 else 0.0
            delays.append(self._delay_s() + lag_s)
        return delays

    def _delay_s(self) -> float:
        """Draw the delay of one copy; what is zero draws nothing, so that a new condition changes no earlier run."""
        radio, chance = self.radio, self._random.random
        delay_s = radio.delay_s + radio.jitter_s * chance()
        if radio.tail > 0.0 and chance() < radio.tail:
            delay_s += self._random.expovariate(1.0 / radio.tail_mean_s)
        if radio.reorder > 0.0 and chance() < radio.reorder:
            delay_s += REORDER_S * chance()
        return delay_s

    def obey(self, arguments: Mapping[str, Any]) -> bool:
        """Change the link conditions by an operator's command; return False, without a change, if it is malformed.

        `cut`: pairs (from, to) of places to disconnect, in addition to those already cut; `mend`: pairs to reconnect;
        `radio`: fields of `Radio`; `fair`: true restores the initial conditions; `heal`: true does that and ends all
        cuts.
        """
        try:
            order = msgspec.convert(dict(arguments), type=_Order)
            radio = self._fair if order.heal or order.fair else self.radio
            self.radio = msgspec.convert(structs.asdict(radio) | order.radio, type=Radio)
        except msgspec.ValidationError:
            return False
        cuts = frozenset() if order.heal else self.cuts
        self.cuts = (cuts | _links(order.cut)) - _links(order.heal_partition)
        return True

    @property
    def orders(self) -> dict[str, Any]:
        """Arguments of `obey` that give another model these link conditions."""
        return {"cut": sorted(self.cuts), "radio": structs.asdict(self.radio)}

    def _out_of_range(self, sender: str, receiver: str) -> bool:
        """Return True if both are robots at known places that are farther apart than the radio reaches."""
        here, there = self.places.get(sender), self.places.get(receiver)
        return here is not None and there is not None and dist(here, there) > self.radio.range_m

    def _lost(self, sender: str, receiver: str) -> bool:
        """Step Gilbert's channel of a link and return True if the message is lost.

        A fade ends with probability 1/burst and starts so that the mean loss is `loss`. Bursts no longer than those of
        independent losses give independent losses.
        """
        loss = self.radio.loss
        leave = min(1.0 / max(self.radio.loss_burst, 1.0), 1.0 - loss)
        enter = leave * loss / (1.0 - loss) if loss < 1.0 else 1.0
        link = (sender, receiver)
        fading = self._fading.get(link, False)
        fading = self._random.random() >= leave if fading else self._random.random() < enter
        self._fading[link] = fading
        return fading


class _Order(Struct, forbid_unknown_fields=True):
    cut: tuple[Link, ...] = ()
    heal_partition: tuple[Link, ...] = msgspec.field(default=(), name="mend")
    radio: dict[str, float] = {}
    fair: bool = False
    heal: bool = False


class Reception:
    """Link model in front of one process on a live bus: messages come out after their delay, or never."""

    def __init__(self, receiver: str, random: Random) -> None:
        self.link_model = LinkModel(CLEAR, random)
        self._receiver = receiver
        self._waiting: list[tuple[float, int, Arrival]] = []
        self._order = 0

    @property
    def is_clear(self) -> bool:
        """True if messages pass without a delay or a loss."""
        return not self._waiting and not self.link_model.cuts and self.link_model.radio == CLEAR

    def put(self, arrival: Arrival) -> None:
        """Queue a message of the bus with its simulated delays; drop it if it is lost."""
        if self.link_model.radio.range_m > 0.0:
            self._locate(arrival)
        link = link_of(arrival.key, self._receiver)
        delays = [0.0] if link is None else self.link_model.delays(*link)
        for delay_s in delays[: WAITING_MAX - len(self._waiting)]:
            self._order += 1
            due = structs.replace(arrival, at=arrival.at + delay_s) if delay_s > 0.0 else arrival
            heapq.heappush(self._waiting, (due.at, self._order, due))

    def _locate(self, arrival: Arrival) -> None:
        """Note where a robot says that it is, in a message that is then lost as well, and where this one is itself."""
        where = address(arrival.key)
        if where is None or where.topic not in _PLACED or not isinstance(arrival.payload, bytes):
            return
        match message_in(arrival.key, arrival.payload):
            case Localization(pose_map=at) | (PoseStamped() as at) | (TableRow(placed=True) as at):
                self.link_model.places[where.owner] = at.x, at.y

    def take(self, now: float) -> list[Arrival]:
        """Return and remove the messages due until `now` [s], in order of time."""
        through = []
        while self._waiting and self._waiting[0][0] <= now:
            through.append(heapq.heappop(self._waiting)[2])
        return through

    def next_due(self) -> float:
        return self._waiting[0][0] if self._waiting else float("inf")
