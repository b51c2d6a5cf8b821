"""Answer to a call of a Trigger service."""

from __future__ import annotations

from lfa.deploy.ros.messages import answer_of_trigger
from lfa.deploy.ros.session import ServiceCall


def answer(call: ServiceCall, *, success: bool, text: str) -> None:
    """Answer a call of a Trigger service."""
    call.answer(answer_of_trigger(success, text))
