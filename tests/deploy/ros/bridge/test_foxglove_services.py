"""Foxglove's buttons: each calls a service that there is, and its request is read or refused."""

from __future__ import annotations

import json
from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfa.deploy.ros.bridge.foxglove_command import FORMATIONS, LAYOUT
from lfa.deploy.ros.bridge.foxglove_output import _request
from lfa.deploy.ros.bridge.inward import PAUSE, SERVICES, SET_BOOL, TRIGGER
from lfa.deploy.ros.types import kind, to_cdr


def test_every_button_of_the_layout_calls_a_service_that_there_is_with_its_request() -> None:
    types = SERVICES | dict.fromkeys(FORMATIONS, TRIGGER)
    panels = json.loads(LAYOUT.read_text())["configById"].items()
    buttons = [panel for name, panel in panels if name.startswith("CallService!")]
    for button in buttons:
        request = json.loads(button["requestPayload"])
        assert [*request] == (["data"] if types[button["serviceName"]] == SET_BOOL else [])
    assert [json.loads(one["requestPayload"]) for one in buttons if one["serviceName"] == PAUSE] == [
        {"data": True},
        {"data": False},
    ]


@pytest.mark.parametrize("paused", [True, False])
def test_the_request_to_pause_says_whether(paused: bool) -> None:
    payload = to_cdr(kind("std_srvs/msg/SetBool_Request")(paused))
    assert _request(SET_BOOL, payload).data is paused  # type: ignore[attr-defined]


@given(st.binary(max_size=12))
def test_any_bytes_call_what_asks_for_nothing_and_are_read_or_refused_elsewhere(payload: bytes) -> None:
    assert _request(TRIGGER, payload) is not None
    with suppress(ValueError):
        assert _request(SET_BOOL, payload).data in (True, False)  # type: ignore[attr-defined]
