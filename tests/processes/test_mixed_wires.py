"""E35 on processes: agents of the last commit with the version of the messages before beside agents of today."""

from __future__ import annotations

import os

import pytest

from lfa.protocol.messages.team import Status
from tests.processes.test_by_hand import Terminals, terminals  # noqa: F401
from tests.rigs.lfa_runs import eventually
from tests.rigs.version_before import code_before

pytestmark = pytest.mark.processes


@pytest.fixture(scope="module")
def before(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Return the environment of a process that runs the code of that commit."""
    return {**os.environ, "PYTHONPATH": str(code_before(tmp_path_factory.mktemp("before")))}


def _chains(terminals: Terminals) -> dict[str, tuple[int, ...]]:  # noqa: F811
    return {m.header.sender: m.chain for m in terminals.heard() if isinstance(m, Status)}


def test_e35_agents_of_both_versions_are_one_chain_and_each_leads_the_other(
    terminals: Terminals,  # noqa: F811
    before: dict[str, str],
) -> None:
    terminals.router()
    terminals.look_on()
    terminals.world(robots=4)
    old = terminals.start("lfa.agents.cli", "--role", "leader", "--id", "1", *terminals.team(), environment=before)
    new = terminals.agent(2)
    terminals.agent(3, environment=before)
    terminals.agent(4)
    eventually(lambda: (1, 2, 3, 4) in _chains(terminals).values(), "not all are in the chain of an old leader")
    old.kill()
    eventually(lambda: _chains(terminals).get("robot3") == (2, 3, 4), "the old do not follow the new leader")
    new.kill()
    eventually(lambda: _chains(terminals).get("robot4") == (3, 4), "the new do not follow the old leader")
