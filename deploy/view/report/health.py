"""Sections of the report on the health of processes and radio."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lfa.deploy.analysis.run_data import Run
from lfa.deploy.analysis.summary import Summary
from lfa.deploy.recording.mcap_reader import messages
from lfa.deploy.recording.recorder import Recording
from lfa.deploy.view.report.html import NONE, in_ms, table


def processes(run: Run, s: Summary) -> str:
    """Return a table of each process's status counters and the regularity of its commands."""
    said: dict[str, list[dict[str, float]]] = {}
    for owner, _, _, status in messages(run.folder, frozenset({"status"})):
        said.setdefault(owner, []).append({name: float(value) for name, value in status.counters.items()})
    rows = []
    for owner in sorted(said):
        own = said[owner]
        commands = run.seen.cmd_vel.get(int(owner.removeprefix("robot"))) if owner.startswith("robot") else None
        gaps = np.diff(commands[:, 0]) if commands is not None and commands.shape[0] > 1 else np.array([])
        rows.append((
            owner, _largest(own, "loop_lag_ms", "ms"), _largest(own, "tick_p99_ms", "ms"),
            _largest(own, "cpu_percent", "%"), _largest(own, "rss_mib", "MiB"),
            _largest(own, "dropped", ""), _largest(own, "undecodable", ""),
            f"{1.0 / gaps.mean():.1f} Hz" if gaps.size else NONE, in_ms(1000.0 * gaps.max()) if gaps.size else NONE,
        ))  # fmt: skip
    heads = (
        "process",
        "largest loop lag",
        "99 % of ticks within",
        "largest CPU share",
        "memory",
        "dropped",
        "undecodable",
        "commands",
        "longest gap",
    )
    kept = s.recording
    return table(heads, rows, text=(0,)) + ("" if kept is None else f"<p class='soft'>{_recorded(kept)}</p>")


def _recorded(kept: Recording) -> str:
    """Return what was recorded and what was lost, with the numbers of `Recording.losses`."""
    lost = sum(hole.missing for hole in kept.holes)
    short = kept.missing - lost
    replaced = f" (besides {short} single values that newer ones replaced)" if short else ""
    return (
        f"Recorded: {kept.messages} messages in {kept.bytes / 1e6:.1f} MB; {lost} never arrived{replaced}, "
        f"{kept.dropped} dropped, {kept.undecodable} undecodable."
    )


def radio(run: Run, _s: Summary) -> str:
    """Return tables of the configured link model and of each robot's loss, by gaps in the received team table rows."""
    radio = run.scenario.radio
    rows = [
        ("delay", in_ms(1000.0 * radio.delay_s)),
        ("jitter", in_ms(1000.0 * radio.jitter_s)),
        ("loss", f"{100.0 * radio.loss:g} %"),
        ("mean losses in a row", f"{radio.loss_burst:g}"),
        ("duplication", f"{100.0 * radio.duplication:g} %"),
        ("held back", f"{100.0 * radio.tail:g} % (mean {in_ms(1000.0 * radio.tail_mean_s)})"),
        ("overtaken", f"{100.0 * radio.reorder:g} %"),
    ]
    heard: dict[str, list[float]] = {}
    for owner, _, _, status in messages(run.folder, frozenset({"status"})):
        if "rows_heard" in status.counters:
            came, missed = float(status.counters["rows_heard"]), float(status.counters["rows_lost"])
            before = heard.setdefault(owner, [0.0, 0.0, 0.0, 0.0])
            ended = before[:2] if came >= before[2] else [before[0] + before[2], before[1] + before[3]]
            heard[owner] = [*ended, came, missed]  # sums of ended incarnations, then counts of the present one
    shares = [(owner, a + c, b + d) for owner, (a, b, c, d) in sorted(heard.items())]
    lost = [
        (owner, f"{came:.0f}", f"{missed:.0f}", f"{100.0 * missed / max(came + missed, 1.0):.1f} %")
        for owner, came, missed in shares
    ]
    heads = ("table rows of the others", "heard", "lost", "share lost")
    return table(("between robots", "as configured"), rows, text=(0,)) + table(heads, lost, text=(0,))


def _largest(own: Sequence[dict[str, float]], name: str, unit: str) -> str:
    values = [counters[name] for counters in own if name in counters]
    return f"{max(values):g} {unit}".rstrip() if values else NONE
