"""What the air does to messages: one model for the simulator and, at a receiver, for the live bus."""

from __future__ import annotations

from random import Random

from msgspec import Struct


class Radio(Struct, frozen=True, forbid_unknown_fields=True):
    """Weather between processes of different robots."""

    delay_s: float = 0.0005
    jitter_s: float = 0.001
    """Uniform, on top of `delay_s`."""
    loss: float = 0.0
    """Probability that one message to one receiver is lost."""
    loss_burst: float = 1.0
    """Mean number of messages lost in a row, where more than chance makes it (Gilbert's two-state channel)."""
    duplication: float = 0.0


class Air:
    """The weather with its memory: chance comes in as a seeded generator."""

    def __init__(self, radio: Radio, random: Random) -> None:
        self.radio = radio
        self._random = random
        self._fading: dict[tuple[str, str], bool] = {}

    def delays(self, sender: str, receiver: str) -> list[float]:
        """After how long [s] a message reaches `receiver`: none when lost, two when doubled."""
        radio = self.radio
        if radio.loss > 0.0 and self._lost(sender, receiver):
            return []
        delays = [radio.delay_s + radio.jitter_s * self._random.random()]
        if radio.duplication > 0.0 and self._random.random() < radio.duplication:
            delays.append(radio.delay_s + radio.jitter_s * self._random.random())
        return delays

    def _lost(self, sender: str, receiver: str) -> bool:
        """Gilbert's channel: leaves a fade with 1/burst, enters one so that the mean loss is `loss`.

        Bursts no longer than independent losses make by themselves are independent losses.
        """
        loss = self.radio.loss
        leave = min(1.0 / max(self.radio.loss_burst, 1.0), 1.0 - loss)
        enter = leave * loss / (1.0 - loss) if loss < 1.0 else 1.0
        link = (sender, receiver)
        fading = self._fading.get(link, False)
        fading = self._random.random() >= leave if fading else self._random.random() < enter
        self._fading[link] = fading
        return fading
