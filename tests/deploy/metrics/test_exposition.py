"""`lfa metrics`: OpenMetrics text that the reference parser accepts, whatever a member of the fleet sends."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from prometheus_client.openmetrics.parser import text_string_to_metric_families

import lfa.deploy.metrics
from lfa.deploy.metrics.collector import FAMILIES, KINDS_MAX, PROCESSES_MAX, ROBOTS_MAX, FleetMetrics
from lfa.deploy.metrics.command import listen_address
from lfa.deploy.metrics.exposition import openmetrics
from lfa.protocol.errors import Refused
from lfa.protocol.geometry import Pose2D, Twist
from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.consensus import (
    Config,
    GatewayStamp,
    LeaseNote,
    Member,
    Propose,
    Role,
    Term,
    Version,
)
from lfa.protocol.messages.fleet import HostStatus, ProcessReport
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.robot import Sensors
from lfa.protocol.messages.team import Event, Level, PoseStamped, Status

TERM = Term(3, 1, 7)


def header(sender: str = "robot1") -> Header:
    return Header(sender, 7, 1, 0.0)


def pose(robot: int) -> PoseStamped:
    return PoseStamped(header(f"robot{robot}"), 0.0, 0.0, 0.0, 0.0, Twist(0.2, 0.0), 1.0, Role.LEADER, TERM)


def status(**counters: float) -> Status:
    return Status(header(), Level.OK, "leader", Role.LEADER, TERM, counters)


def sensors(refused: int = 4) -> Sensors:
    return Sensors(header("world"), Pose2D(), Twist(0.0, 0.0), 0.0, GatewayStamp(1, 0.0), TERM, True, refused)


def values(metrics: FleetMetrics, now: float = 1.5) -> dict[tuple[str, tuple[tuple[str, str], ...]], float]:
    """The samples as the reference parser of OpenMetrics reads them."""
    text = openmetrics(FAMILIES, metrics.samples(now))
    return {
        (sample.name, tuple(sorted(sample.labels.items()))): sample.value
        for family in text_string_to_metric_families(text)
        for sample in family.samples
    }


def heard(*messages: tuple[str, Message]) -> FleetMetrics:
    metrics = FleetMetrics("demo")
    for key, message in messages:
        metrics.update(1.0, f"lfa/demo/{key}", 100, message)
    return metrics


def test_a_leader_shows_term_role_lag_gateway_and_traffic() -> None:
    found = values(
        heard(
            ("robot1/pose", pose(1)),
            ("robot1/status", status(loop_lag_ms=1.5, cpu_percent=50.0)),
            ("robot1/sensors", sensors()),
        )
    )
    robot = ("robot", "robot1")
    assert found["lfa_term", (robot,)] == 3
    assert found["lfa_role", (robot, ("role", "leader"))] == 1
    assert found["lfa_loop_lag_seconds", (robot,)] == 0.0015
    assert found["lfa_cpu_ratio", (robot,)] == 0.5
    assert found["lfa_gateway_refusals_total", (robot,)] == 4
    assert found["lfa_gateway_latched", (robot,)] == 1
    assert found["lfa_router_bytes_total", (("topic", "pose"),)] == 100


def test_the_lease_ages_from_its_last_renewal() -> None:
    one = Member(1, 7)
    config = Config(Version(TERM, 0), (one,), None, None, (one,))
    metrics = heard(("robot1/lease/all", LeaseNote(header(), Propose(TERM, config, 1, one))))
    assert values(metrics, now=1.25)["lfa_lease_age_seconds", (("robot", "robot1"),)] == 0.25


def test_a_silent_robot_has_no_role_and_an_age() -> None:
    found = values(heard(("robot1/pose", pose(1))), now=11.0)
    assert found["lfa_pose_age_seconds", (("robot", "robot1"),)] == 10.0
    assert [value for (name, _), value in found.items() if name == "lfa_role"] == [0, 0, 0]
    assert "lfa_term" not in {name for name, _ in found}


def test_their_number_is_bounded_whatever_members_send() -> None:
    poses = [(f"robot{n}/pose", pose(n)) for n in range(1, 2 * ROBOTS_MAX)]
    events = [("robot1/event", Event(header(), f"kind {n}" + "x" * 5000, None, {})) for n in range(4 * KINDS_MAX)]
    reports = tuple(ProcessReport(f"p{n}", "running", 1, 1, 0, 0.0, "") for n in range(2 * PROCESSES_MAX))
    host = HostStatus(header("host-a"), "a", "", "", (0, 0), reports)
    text = openmetrics(FAMILIES, heard(*poses, *events, ("host-a/host", host)).samples(1.5))
    assert text.count("\nlfa_role{") == 3 * ROBOTS_MAX
    assert text.count("\nlfa_events_total{") == KINDS_MAX + 1
    assert text.count("\nlfa_process_running{") == PROCESSES_MAX
    assert len(text) < 1_000_000


@settings(max_examples=60, deadline=None)
@given(kind=st.text(max_size=80), lag=st.floats(), refused=st.integers(-5, 2**60), process=st.text(max_size=20))
def test_the_reference_parser_reads_the_text_whatever_members_send(
    kind: str, lag: float, refused: int, process: str
) -> None:
    kind, process = (text.encode(errors="replace").decode() for text in (kind, process))
    twice = (ProcessReport(process, "running", 1, -3, 0, 0.0, ""),) * 2
    values(
        heard(
            ("robot1/event", Event(header(), kind, None, {})),
            ("robot1/status", status(loop_lag_ms=lag, dropped=lag)),
            ("robot1/sensors", sensors(refused)),
            ("host-a/host", HostStatus(header("host-a"), "a", "", "", (0, 0), twice)),
        )
    )


def test_the_dashboard_asks_for_metrics_that_exist() -> None:
    dashboard = Path(lfa.deploy.metrics.__file__).parent / "grafana.json"
    asked = [
        target["expr"] for panel in json.loads(dashboard.read_text())["panels"] for target in panel.get("targets", ())
    ]
    suffix = {"counter": "_total", "gauge": "", "info": "_info"}
    names = {family.name + suffix[family.kind] for family in FAMILIES}
    assert asked
    assert [text for text in asked if not any(name in text for name in names)] == []


@pytest.mark.parametrize("text", ["", "9464", "127.0.0.1:", ":80", "127.0.0.1:0", "127.0.0.1:70000", "a:1e3"])
def test_an_address_without_a_port_is_refused(text: str) -> None:
    with pytest.raises(Refused, match="must be an address and a port"):
        listen_address(text)
