"""The performance table of deploy/docs/performance.md, from the JSON of the benches: `make bench-table`.

`python -m tests.bench_table [BENCH[/GLOB]]...` runs these benches, all of `BENCHES` by default, keeps their rows in
`runs/bench`, and puts them into the table, in the place of rows of the same names. What falls short is named with its
next bottleneck.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Mapping, Sequence
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "deploy" / "docs" / "performance.md"
KEPT = ROOT / "runs" / "bench"
BEGIN, END = "<!-- begin: make bench-table -->\n", "<!-- end -->"
BENCHES = (
    "lidar", "world", "sim", "agent", "agents", "lockstep", "latency", "router", "failover", "operate", "soak", "learn",
)  # fmt: skip
"""Benches of the table; those of driving and of campaigns have pages of their own."""
BOTTLENECKS = {
    "sim/1000*": "the first election, in which each process hears the tokens, HELLO and table rows of all",
    "sim/*": "the interpreter: no function takes a twentieth of the time; the agents' control steps take a quarter, "
    "what they hear a fifth (a third with 100 robots), recording, journals and codec together as much",
    "agent*/*share of a core*": "the agent's own Python, two thirds of its time: half of that hears, a quarter steps; "
    "the last third are Zenoh's threads, which wake for each message",
    "agent*/*": "the scheduler: more processes are ready than cores",
    "latency/*pose to accepted command*": "two hops through the router, each with two wake-ups of its threads, and the "
    "control step itself",
    "latency/kill of the leader/*": "a third passes until the vanished token is heard, the rest in four exchanges "
    "through the router: promises, fence, grants, command",
    "lockstep/*": "the agents' own steps and codec, as in `lfa sim`; then two wake-ups for each of some 270 "
    "grants a second",
    "router/*delivered*": "publishers that are not scheduled in time: state topics are dropped when a link is full",
    "failover/*": "the link lease, and the starts of processes beside the others",
    "soak/*": "what Zenoh keeps of each session with subscriptions that has ended",
}
"""Next bottleneck, by profile, of a row `BENCH/NAME` that falls short; the first pattern that fits."""


def main(chosen: Sequence[str]) -> None:
    """Run the benches and write the table into the page."""
    for name in chosen or BENCHES:
        bench, _, glob = name.partition("/")
        keep(bench, rows_of(bench, glob))
    whole = PAGE.read_text(encoding="utf-8")
    PAGE.write_text(with_table(whole, text(kept(on_page(whole)))), encoding="utf-8")


def rows_of(bench: str, glob: str) -> list[dict[str, Any]]:
    """Return the rows of a bench, those whose names match `glob`. Raises SystemExit if it prints none."""
    words = [sys.executable, "-c", "from lfa.deploy.cli import main; main()", "bench", bench, "--json"]
    done = subprocess.run([*words, *(("--rows", glob) if glob else ())], stdout=subprocess.PIPE, text=True, check=False)
    try:
        rows: list[dict[str, Any]] = json.loads(done.stdout.strip().splitlines()[-1])["rows"]
    except (ValueError, IndexError, KeyError, TypeError):
        raise SystemExit(f"lfa bench {bench} has printed no rows (exit code {done.returncode})") from None
    return rows


def keep(bench: str, rows: Sequence[Mapping[str, Any]]) -> None:
    """Put rows in the place of those of the same names in the bench's file."""
    KEPT.mkdir(parents=True, exist_ok=True)
    file = KEPT / f"{bench}.json"
    before = json.loads(file.read_text()) if file.is_file() else []
    known = {row["name"]: row for row in [*before, *rows]}
    file.write_text(json.dumps(list(known.values()), indent=1))


def kept(before: Mapping[str, Sequence[Mapping[str, Any]]]) -> dict[str, list[dict[str, Any]]]:
    """Return the rows kept so far, by bench, in the order of `BENCHES`, and those of `before` that no run replaces."""
    rows: dict[str, list[dict[str, Any]]] = {}
    for name in BENCHES:
        file = KEPT / f"{name}.json"
        newer = json.loads(file.read_text()) if file.is_file() else []
        known = {row["name"]: dict(row) for row in [*before.get(name, ()), *newer]}
        if known:
            rows[name] = list(known.values())
    return rows


def on_page(page: str) -> dict[str, list[dict[str, Any]]]:
    """Return the rows of the table on the page, by bench."""
    rows: dict[str, list[dict[str, Any]]] = {}
    for line in page.partition(BEGIN)[2].partition(END)[0].splitlines()[2:]:
        if not line.startswith("| "):
            break
        bench, name, measured, bar, ratio, mark = (cell.strip() for cell in line.strip("|").split("|"))
        value, _, unit = measured.partition(" ")
        row = {"name": name, "value": float(value), "unit": unit or "1", "ok": mark != "short"}
        row |= {"bar": float(bar) if bar else None, "ratio": float(ratio) if ratio else None}
        rows.setdefault(bench, []).append(row)
    return rows


def text(benches: Mapping[str, Sequence[Mapping[str, Any]]]) -> str:
    """Return the table as Markdown, and a line for each row with a bar that falls short."""
    lines = ["| bench | row | value | bar | ratio | |", "| --- | --- | --- | --- | --- | --- |"]
    short = []
    for bench, rows in benches.items():
        for row in rows:
            bar = "" if row["bar"] is None else f"{row['bar']:.4g}"
            ratio = "" if row["ratio"] is None else f"{row['ratio']:.3g}"
            mark = "" if row["bar"] is None else "ok" if row["ok"] else "short"
            value = f"{row['value']:.4g} {'' if row['unit'] == '1' else row['unit']}".strip()
            lines.append(f"| {bench} | {row['name']} | {value} | {bar} | {ratio} | {mark} |")
            if mark == "short":
                short.append(f"- `{bench}` {row['name']}: next bottleneck: {bottleneck(bench, row['name'])}.")
    return "\n".join([*lines, "", *(["What falls short:", "", *short] if short else ["Nothing falls short."]), ""])


def bottleneck(bench: str, row: str) -> str:
    """Return what a row that falls short waits for, as profiles show it."""
    name = f"{bench}/{row}"
    return next((why for pattern, why in BOTTLENECKS.items() if fnmatchcase(name, pattern)), "not profiled yet")


def with_table(page: str, table: str) -> str:
    """Return the page with `table` between its marks."""
    return re.sub(f"{BEGIN}.*?{END}", lambda _: BEGIN + table + END, page, flags=re.DOTALL)


if __name__ == "__main__":
    main(sys.argv[1:])
