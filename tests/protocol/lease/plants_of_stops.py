"""How the rules of the fleet stop are broken on purpose, each by a patch."""

from __future__ import annotations

from typing import Any

import pytest

from lfa.protocol.fleet_stop.latch import StopLatch
from lfa.protocol.fleet_stop.memory import StopMemory
from lfa.protocol.messages.stop import StopKnowledge, StopOrder


def stop_is_not_held(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(StopLatch, "holds", lambda self, now: not self._certain)


def replayed_words_are_believed(patch: pytest.MonkeyPatch) -> None:
    honest = StopLatch.order

    def order(self: StopLatch, order: StopOrder, now: float) -> None:
        if order.word is not None:
            self._word = order.word
        honest(self, order, now)

    patch.setattr(StopLatch, "order", order)


def gateway_that_starts_may_go(patch: pytest.MonkeyPatch) -> None:
    _certain_from_the_start(patch, StopLatch, "_certain")


def agent_that_starts_knows_all(patch: pytest.MonkeyPatch) -> None:
    _certain_from_the_start(patch, StopMemory, "certain")


def _certain_from_the_start(patch: pytest.MonkeyPatch, kind: type, field: str) -> None:
    honest = kind.__init__  # type: ignore[misc]

    def begin(self: Any, *arguments: Any, **more: Any) -> None:
        honest(self, *arguments, **more)
        setattr(self, field, True)

    patch.setattr(kind, "__init__", begin)


def agent_lifts_a_stop(patch: pytest.MonkeyPatch) -> None:
    def hear_agent(self: StopLatch, known: StopKnowledge) -> None:
        self._agent_word = known.word
        self._word, self._certain = max(self._word, known.word), self._certain or known.certain

    patch.setattr(StopLatch, "hear_agent", hear_agent)


def any_resume_lets_a_started_gateway_go(patch: pytest.MonkeyPatch) -> None:
    honest = StopLatch.order

    def order(self: StopLatch, order: StopOrder, now: float) -> None:
        honest(self, order, now)
        self._certain = self._certain or order.word is not None

    patch.setattr(StopLatch, "order", order)


def replayed_order_is_a_sign_of_life(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(StopLatch, "_is_new", lambda self, header: True)
