"""Page of the report: sections of tables and figures; two runs are shown side by side."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Callable, Sequence
from html import escape
from pathlib import Path

from lfa.deploy.analysis import summary
from lfa.deploy.analysis.run_data import Run
from lfa.deploy.analysis.summary import RobotSummary, Summary
from lfa.deploy.analysis.tracking_errors import SETTLED_M
from lfa.deploy.client.term_count import TermCount
from lfa.deploy.recording import event_log
from lfa.deploy.recording.run_folder import SCENARIO
from lfa.deploy.view.figures import catalogue
from lfa.deploy.view.figures.catalogue import FIGURES
from lfa.deploy.view.report import health
from lfa.deploy.view.report.charts import charts_of
from lfa.deploy.view.report.html import NONE, Cells, in_deg, in_mm, in_ms, in_s, short, table

HERE = Path(__file__).parent
ROWS_MAX = 150


def of(runs: Sequence[Run]) -> str:
    """Return the whole page as HTML, for one or two runs."""
    sums = [summary.read(run.folder) for run in runs]
    title = " and ".join(f"{s.scenario}, seed {s.seed}" for s in sums)
    parts = [_side_by_side(runs, sums, lambda run, s: _head(run, s))]
    if len(runs) == 2:
        parts.append(f'<h2 id="compared">Compared</h2>{_compared(*sums)}')
    for name, section in SECTIONS:
        parts.append(f'<h2 id="{_id(name)}">{escape(name)}</h2>{_side_by_side(runs, sums, section)}')
    links = " ".join(f'<a href="#{_id(name)}">{escape(name)}</a>' for name, _ in SECTIONS)
    two = ' class="two"' if len(runs) == 2 else ""
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>lfa: {escape(title)}</title>'
        f'<meta name="viewport" content="width=device-width, initial-scale=1"><link rel="icon" href="data:,">'
        f"<style>{_text('uplot/uPlot.min.css')}{_text('report.css')}</style></head>"
        f"<body{two}><nav>{links}</nav>{''.join(parts)}"
        f"<script>{_text('uplot/uPlot.iife.min.js')}</script><script>{_text('charts.js')}</script></body></html>\n"
    )


def _text(name: str) -> str:
    """Return a script or style sheet that lies beside this file: the page asks for nothing from elsewhere."""
    return (HERE / name).read_text(encoding="utf-8")


def _side_by_side(runs: Sequence[Run], sums: Sequence[Summary], section: Callable[[Run, Summary], str]) -> str:
    sections = [section(run, s) for run, s in zip(runs, sums, strict=True)]
    return (
        sections[0]
        if len(sections) == 1
        else f'<div class="columns">{"".join(f"<div>{t}</div>" for t in sections)}</div>'
    )


# --- sections -------------------------------------------------------------------------------------------------------


def _head(run: Run, s: Summary) -> str:
    good = s.exit_code == 0
    badge = f'<span class="badge {"ok" if good else "bad"}">{"✓" if good else "✗"} {escape(s.outcome)}</span>'
    reason = "" if s.reason is None else f' <span class="soft">{escape(s.reason)}</span>'
    settled = [r for r in s.robots if r.distance_error_rms_m is not None]
    worst = max(settled, key=lambda r: r.distance_error_rms_m or 0.0, default=None)
    took = [f.first_command_ms for f in s.failovers if f.first_command_ms is not None]
    tiles = (
        ("duration", f"{s.sim_duration_s:.1f} s"),
        ("times real time", f"{s.real_time_factor:g}"),
        ("largest rms distance error", NONE)
        if worst is None
        else (f"rms distance error of robot {worst.id}, the largest", in_mm(worst.distance_error_rms_m)),
        ("leaders", len(s.leaders)),
        ("slowest failover", f"{max(took):.0f} ms" if took else NONE),
        ("contacts", sum(r.contacts for r in s.robots)),
    )
    shown = "".join(f'<div class="tile"><b>{escape(str(value))}</b>{name}</div>' for name, value in tiles)
    about = f"{s.scenario}, {s.mode}, seed {s.seed}, {len(s.robots)} robots, in {run.folder.name}"
    return (
        f"<h1>{escape(run.scenario.title)}</h1><p class='soft'>{escape(about)}</p>"
        f'{_made(s)}<p>{badge}{reason}</p><div class="tiles">{shown}</div>{_assertions(s)}'
    )


def _made(s: Summary) -> str:
    """Return what made the run, where, and by which command."""
    p = s.provenance
    if p is None:
        return ""
    at = "" if p.commit is None else f" (commit {p.commit})"
    text = f"lfa {p.version}{at}, Python {p.python}, {p.system}, on {p.host}"
    return f"<p class='soft small'>{escape(text)}<br><code>{escape(p.command)}</code></p>"


def _assertions(s: Summary) -> str:
    rows = [("✓" if a.ok else "✗", a.name, getattr(a, "text", "")) for a in s.assertions]
    rows += [("✗", v.invariant, f"at {v.at_s:.3f} s: {v.text}") for v in s.violations]
    return table(("", "what must hold", ""), rows, text=(1, 2))


def _robots(_run: Run, s: Summary) -> str:
    heads = ("robot", "at the end", "distance error rms", "largest", "orientation rms", "to body (paper)",
             "heading rms", "settled after", "contacts", "obstacles met")  # fmt: skip
    return table(heads, [_robot(r) for r in s.robots], text=(1, 9)) + (
        "<p class='soft'>All errors from when a follower had settled, that is, stays within "
        f"{1000.0 * SETTLED_M:.0f} mm of its distance; rms values with avoidance and formation changes left out, the "
        "largest with nothing left out. The curves below show everything; beside each name is the rms value of this "
        "table. – : a leader, or a robot that never settled.</p>"
    )


def _robot(r: RobotSummary) -> Cells:
    met = ", ".join(f"{count} {kind}" for kind, count in r.obstacles_met.items() if count)
    angles = (r.bearing_error_rms_rad, r.bearing_error_body_rms_rad, r.heading_error_rms_rad)
    return (r.id, r.role_at_end if r.alive else "gone", in_mm(r.distance_error_rms_m), in_mm(r.distance_error_max_m),
            *(in_deg(angle) for angle in angles), in_s(r.settled_after_s), r.contacts, met or NONE)  # fmt: skip


def _figure(name: str) -> Callable[[Run, Summary], str]:
    def draw(run: Run, s: Summary) -> str:
        data = b64encode(catalogue.svg(catalogue.drawn(name, run))).decode()
        title = next(title for known, _, title, _ in FIGURES if known == name)
        charts = charts_of(name, run, s)
        drawn = ' class="drawn"' if charts else ""
        return f'{charts}<figure{drawn}><img alt="{escape(title)}" src="data:image/svg+xml;base64,{data}"></figure>'

    return draw


def _leaders(run: Run, s: Summary) -> str:
    terms = TermCount(r.term[0] for r in s.leaders)
    leader_terms = table(
        ("robot", "term", "from", "until", "because of"),
        [(r.robot_id, terms.number(r.term[0]), in_s(r.from_s), in_s(r.until_s), r.cause) for r in s.leaders],
        text=(4,),
    )
    failovers = table(
        ("lost", "by", "at", "next", "lease held after", "first command after", "chain closed after"),
        [
            (
                f.victim,
                f.cause,
                in_s(f.at_s),
                f.leader or NONE,
                in_ms(f.lease_ms),
                in_ms(f.first_command_ms),
                in_ms(f.chain_ms),
            )
            for f in s.failovers
        ],
    )
    timelines = _figure("leader_timeline")(run, s) + _figure("lease_timeline")(run, s)
    return timelines + leader_terms + ("<h3>Failovers</h3>" + failovers if s.failovers else "")


def _faults(run: Run, s: Summary) -> str:
    if not s.faults:
        return "<p>None.</p>"
    rows = [(in_s(f.at_s), f.kind, f.target, *recovery(run, f)) for f in s.faults]
    return table(("at", "what", "target", "chain without it after", "back in the chain after"), rows, text=(1,))


def recovery(run: Run, fault: event_log.FaultDone) -> tuple[str, str]:
    """Return the times from the fault to the first chain without the victim, and to the next chain with it.

    A fault of links between several, or of the radio, has no victim.
    """
    if fault.target not in run.robots or fault.kind in ("heal", "loss", "range"):
        return NONE, NONE
    without: float | None = None
    for line in event_log.of_kind([e for e in run.events if e["t"] >= fault.at_s], "chain"):
        member = fault.target in line.get("chain", [])
        if without is None and not member:
            without = line["t"] - fault.at_s
        elif without is not None and member:
            return in_ms(1000.0 * without), in_s(line["t"] - fault.at_s)
    return (NONE if without is None else in_ms(1000.0 * without)), NONE


def _decisions(run: Run, _s: Summary) -> str:
    wanted = ("decision", "formation", "goal", "contact", "failed", "died", "slowed")
    lines = [line for line in run.events if line["kind"] in wanted]
    rows = [(f"{line['t']:.2f} s", line["robot"] or NONE, line["kind"], _details(line)) for line in lines[:ROWS_MAX]]
    rest = f"<p class='soft'>{len(lines) - ROWS_MAX} more in events.jsonl.</p>" if len(lines) > ROWS_MAX else ""
    opened = f"<details><summary>{len(lines)} lines</summary>"
    return f"{opened}{table(('at', 'robot', 'kind', 'what'), rows, text=(2, 3))}{rest}</details>"


def _details(line: event_log.Line) -> str:
    left_out = ("t", "robot", "term", "kind", "from")
    return ", ".join(f"{name} {short(value)}" for name, value in line.items() if name not in left_out)


def _configuration(run: Run, _s: Summary) -> str:
    text = escape((run.folder / SCENARIO).read_text(encoding="utf-8"))
    return f"<details><summary>{SCENARIO}, every field, as the seed drew it</summary><pre>{text}</pre></details>"


SECTIONS: tuple[tuple[str, Callable[[Run, Summary], str]], ...] = (
    ("Robots", _robots),
    ("Paths over the map", _figure("fig09_path_flow")),
    ("Distance error", _figure("fig07_distance_error")),
    ("Orientation error", _figure("fig08_orientation_error")),
    ("Tracking controller", _figure("fig11_tracking")),
    ("String stability", _figure("string_stability")),
    ("Leaders", _leaders),
    ("Faults and recoveries", _faults),
    ("Decisions", _decisions),
    ("Processes", health.processes),
    ("Radio", health.radio),
    ("Configuration", _configuration),
)


# --- two runs -------------------------------------------------------------------------------------------------------


def _compared(a: Summary, b: Summary) -> str:
    """Return a table of values of both runs, and the difference second minus first."""
    rows: list[Cells] = [
        ("outcome", a.outcome, b.outcome, NONE if a.outcome == b.outcome else "differs"),
        _row("duration [s]", a.sim_duration_s, b.sim_duration_s, 1),
        _row("contacts", sum(r.contacts for r in a.robots), sum(r.contacts for r in b.robots), 0),
    ]
    took = [[f.first_command_ms for f in s.failovers if f.first_command_ms is not None] for s in (a, b)]
    rows.append(_row("slowest failover [ms]", max(took[0], default=None), max(took[1], default=None), 1))
    theirs = {r.id: r for r in b.robots}
    for r in a.robots:
        other = theirs.get(r.id)
        if other is None or (r.distance_error_rms_m is None and other.distance_error_rms_m is None):
            continue
        rows += [
            _row(f"robot {r.id}: {name}", _scaled(r, field, scale), _scaled(other, field, scale), 2)
            for name, field, scale in (
                ("distance error rms [mm]", "distance_error_rms_m", 1000.0),
                ("orientation error rms [deg]", "bearing_error_rms_rad", 57.2958),
                ("settled after [s]", "settled_after_s", 1.0),
            )
        ]
    return table(("", "first", "second", "second − first"), rows, text=(0,))


def _scaled(r: RobotSummary, field: str, scale: float) -> float | None:
    value = getattr(r, field)
    return None if value is None else value * scale


def _row(name: str, a: float | None, b: float | None, digits: int) -> Cells:
    both = a is not None and b is not None
    texts = [NONE if value is None else f"{value:.{digits}f}" for value in (a, b)]
    return (name, *texts, f"{b - a:+.{digits}f}" if both else NONE)  # type: ignore[operator]


def _id(name: str) -> str:
    return name.lower().replace(" ", "-")
