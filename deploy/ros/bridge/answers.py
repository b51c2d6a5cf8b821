"""Answer to a call of one of the bridge's services."""

from __future__ import annotations

from lfa.deploy.ros.messages import answer_of_service
from lfa.deploy.ros.session import ServiceCall


def answer(call: ServiceCall, *, success: bool, text: str) -> None:
    """Answer a call of a Trigger or SetBool service."""
    call.answer(answer_of_service(success, text))
