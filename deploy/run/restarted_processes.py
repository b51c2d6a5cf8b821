"""Restarts of a run's processes: by the scenario's policy, by its faults, and by hand."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from lfa.deploy.process.process_group import ProcessGroup, ProcessSpec
from lfa.deploy.process.restart_policy import RUN, RestartBackoff
from lfa.protocol.names import robot_id_of


class RestartedProcesses:
    """Processes of a run with the policy of each; `publish_event` gets kind and data of an event."""

    def __init__(
        self,
        group: ProcessGroup,
        rows: Sequence[ProcessSpec],
        policies: Mapping[str, str],
        publish_event: Callable[..., None],
    ) -> None:
        self.group = group
        self._rows = {row.name: row for row in rows}
        self._backoffs = {name: RestartBackoff(RUN) for name in self._rows if _policy(policies, name) == RUN.policy}
        self._start_at: dict[str, float] = {}
        self._restarted: list[str] = []
        """Restarted processes whose `restarted` event is not yet published."""
        self._publish_event = publish_event

    @property
    def restarting(self) -> bool:
        """True from a restart until the world is heard again."""
        return bool(self._restarted)

    def revives(self, name: str, now: float) -> bool:
        """Restart a failed process when that is due; return False if its policy leaves it ended, or it runs."""
        code = self.group.code(name)
        backoff = self._backoffs.get(name)
        if backoff is None or code is None:
            return False
        if name not in self._start_at:
            decision = backoff.ended(code, now)
            if decision.at is None:
                return False
            self._start_at[name] = decision.at
        if now >= self._start_at[name]:
            del self._start_at[name]
            self.start_again(name)
            self._restarted.append(name)
        return True

    def start_again(self, name: str) -> None:
        self.group.start(self._rows[name].restarted())

    def report_restarts(self, time_s: float) -> None:
        """Publish the restarts, once the world is heard: messages published while the router is down are lost."""
        while self._restarted:
            name = self._restarted.pop(0)
            self._publish_event("restarted", name=name, robot=robot_id_of(name), t=time_s)


def _policy(policies: Mapping[str, str], name: str) -> str | None:
    return policies.get(name, policies.get("robots") if name.startswith("robot") else None)
