"""Scripts: text files of commands, each block with the trace that it must give.

    # Why this trace is kept, in a sentence.
    team 1 2 3 4 witness
    start all
    run 400
    ----
        301.0  robot1 ...

`team` comes first. Times are in milliseconds. The commands are the methods `_do_...` below, with their docstrings.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from lfa.protocol.lease.machine.lease import Lease
from lfa.protocol.messages.consensus import Member
from lfa.protocol.mission import Leading, Mission
from tests.protocol.lease.traces.stage import Stage
from tests.protocol.lease.traces.trace import Trace, text_of_config

RULE = "----"
BEGIN_S = 0.5


def play(path: Path) -> str:
    """Return the text of the script at `path` with the traces that its commands give today."""
    return "\n\n".join(_blocks(path.read_text())) + "\n"


def _blocks(text: str) -> Iterator[str]:
    why, *blocks = re.split(r"\n\n+", text.strip())
    if not all(line.startswith("# ") for line in why.splitlines()):
        raise ValueError("the first block must say in a sentence why the trace is kept: # ...")
    yield why
    player = _Player()
    for block in blocks:
        orders, _, _ = block.partition(RULE)
        player.play(orders.split("\n"))
        yield "\n".join([orders.rstrip("\n"), RULE, *player.trace.drain()])


class _Player:
    """Runs the commands of one script."""

    def __init__(self) -> None:
        self.trace = Trace()
        self.stage = Stage(Mission(), self.trace)

    def play(self, orders: list[str]) -> None:
        for order in filter(None, orders):
            name, *arguments = order.split()
            do: Callable[..., None] | None = getattr(self, f"_do_{name}", None)
            if do is None:
                raise ValueError(f"{order!r}: no such command")
            do(*arguments)

    def _do_team(self, *words: str) -> None:
        """team 1 2 3 4 [witness] [field=value ...]: fields of `Mission`."""
        fields: dict[str, Any] = dict(word.split("=") for word in words if "=" in word)
        if "can_lead" in fields:
            fields["can_lead"] = tuple(map(int, fields["can_lead"].split(",")))
        if "continue_after_s" in fields:
            fields["continue_after_s"] = float(fields["continue_after_s"])
        robots = tuple(int(word) for word in words if word.isdigit())
        leading = Leading(route_m=((1.0, 0.0),))
        self.stage = Stage(Mission(robots, witness="witness" in words, leading=leading, **fields), self.trace)

    def _do_start(self, *ids: str) -> None:
        """start all | start 3 4: start new incarnations; the witness is 0."""
        for robot_id in self.stage.ids if ids == ("all",) else map(int, ids):
            self.stage.start(robot_id)

    def _do_begin(self) -> None:
        """begin: start all, and let the first leader lead for a while, without a trace (cold_start.txt shows it)."""
        self._do_start("all")
        self.stage.run(BEGIN_S)
        self.trace.drain()

    def _do_run(self, for_ms: str) -> None:
        self.stage.run(float(for_ms) / 1000.0)

    def _do_kill(self, robot_id: str, how: str = "") -> None:
        """kill 1 [silently]: silently means that its token stays, as when a machine loses its power."""
        self.stage.kill(int(robot_id), hinted=how != "silently")

    def _do_exit(self, robot_id: str) -> None:
        self.stage.order(int(robot_id), "SIGTERM", Lease.request_release)

    def _do_handover(self, robot_id: str) -> None:
        self.stage.order(int(robot_id), "is stuck", Lease.request_handover)

    def _do_pause(self, robot_id: str) -> None:
        self.stage.pause(int(robot_id))

    def _do_resume(self, robot_id: str) -> None:
        self.stage.resume(int(robot_id))

    def _do_hint(self, about: str, what: str, _to: str, *observers: str) -> None:
        """hint 1 gone to 2 3 | hint 1 there to 2: a liveliness event, true or not."""
        self.stage.hint(int(about), [int(o) for o in observers], up=what == "there")

    def _do_forget(self, *lost: str) -> None:
        """forget 3 4: an operator says to all robots that these incarnations are dead for good."""
        members = tuple(self.stage.processes[int(robot_id)].member for robot_id in lost)
        for process in self.stage.processes.values():
            if process.alive and process.member.id:
                self.stage.order(process.member.id, "operator", lambda lease, now: lease.request_forget(members, now))

    def _do_leave_out(self, leader: str, *robots: str) -> None:
        """leave_out 1 3: leader 1 keeps robot 3, which is stuck, out of its chain; without robots: nobody."""
        self.stage.processes[int(leader)].lease.left_out = frozenset(map(int, robots))

    def _do_latch(self, robot_id: str) -> None:
        """latch 1: the gateway of robot 1 sees its agent's token vanish, wrongly."""
        gateway = self.stage.gateways[int(robot_id)]
        gateway.agent_down(self.stage.processes[int(robot_id)].member.incarnation, self.stage.now)

    def _do_cut(self, *words: str) -> None:
        """cut 1 2 | 3 4 0: no message between the groups."""
        groups = [[int(i) for i in group.split()] for group in " ".join(words).split("|")]
        sides = [(one, other) for one in groups for other in groups if one is not other]
        self.stage.cuts |= {(a, b) for one, other in sides for a in one for b in other}

    def _do_delay(self, link: str, ms: str) -> None:
        """delay 1->2 30: messages from 1 to 2 take 30 ms from now on."""
        src, to = link.split("->")
        self.stage.delays[int(src), int(to)] = float(ms) / 1000.0

    def _do_lose(self, kind: str, *links: str) -> None:
        """lose GRANT 2->1 ...: such messages (* any) get lost from now on; gateway 1 is -1."""
        for link in links:
            src, to = link.split("->")
            self.stage.losses.append((kind, int(src), int(to)))

    def _do_heal(self) -> None:
        """heal: no cut, loss or delay any more."""
        self.stage.cuts.clear()
        self.stage.losses.clear()
        self.stage.delays.clear()

    def _do_show(self) -> None:
        """show: what each process that runs believes."""
        for process in self.stage.processes.values():
            lease = process.lease
            if process.alive:
                member = Member(process.member.id, process.member.incarnation)
                config = text_of_config(lease.config) if lease.chain else "no config"
                self.trace.note(self.stage.now, member, f"{lease.role.value}, leader {lease.leader}; {config}")
