"""Answer to a call of a Trigger service."""

from __future__ import annotations

from typing import Any

from lfa.deploy.ros.session import ServiceCall
from lfa.deploy.ros.types import kind


def answer(call: ServiceCall, *, success: bool, text: str) -> None:
    """Answer a call of a Trigger service."""
    response: Any = kind("std_srvs/msg/Trigger_Response")(success=success, message=text)
    call.answer(response)
