"""`lfa why`: the shortest chain of causes of each leader change, stop, contact and wait of a run."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import msgspec
import typer
from msgspec import Struct

from lfa.deploy.analysis.causes import effects, evidence, orders
from lfa.deploy.analysis.causes.fact import EFFECTS, FAILURES, Fact
from lfa.deploy.analysis.causes.rules import CauseChain, explain
from lfa.deploy.analysis.causes.run_trace import read
from lfa.deploy.recording import event_log, mcap_reader
from lfa.deploy.recording.run_folder import scenario_of
from lfa.deploy.terminal_text import print_visible
from lfa.protocol.errors import Refused

NEAR_S = 5.0
"""Distance [s] from `--at` within which an effect is looked for."""


class Causes(Struct, frozen=True):
    """Chains of all effects of a run by time, and the failures that no chain names."""

    run: str
    chains: tuple[CauseChain, ...]
    without_effect: tuple[Fact, ...]


def command(
    folder: Annotated[Path, typer.Argument(metavar="RUN", help="A run folder with journals.")],
    of: Annotated[str | None, typer.Option(help=f"Only effects of this kind: {', '.join(EFFECTS)}.")] = None,
    at: Annotated[float | None, typer.Option(help="Only the effect that is nearest to this time [s].")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print chains and failures as JSON.")] = False,
) -> int:
    kind = None if of is None else of.replace("-", " ")
    if kind is not None and kind not in EFFECTS:
        raise Refused(f"--of {of}: must be one of {', '.join(EFFECTS)}")
    found = _chosen(why(folder), kind, at)
    if as_json:
        print_visible(msgspec.json.encode(found).decode())
    else:
        print_visible("\n".join(lines(found)))
    return 0


def why(folder: Path) -> Causes:
    """Return the chains of causes of the run in `folder`. Raises Refused without a recording and journals."""
    mcap_reader.look_into(folder)
    seen, events = mcap_reader.read(folder), event_log.lines(folder)
    over_s = next((line["t"] for line in events if line["kind"] in ("over", "end")), seen.end_s)
    failures = evidence.failures(read(folder, over_s))
    done = effects.facts(seen, events, sorted(seen.truth))
    ordered = orders.facts(folder, scenario_of(folder).mission)
    known = sorted([*failures, *done, *ordered], key=lambda fact: fact.at_s)
    chains = tuple(explain(fact, known) for fact in done if fact.kind in EFFECTS)
    named = {fact for chain in chains for fact in chain.facts}
    return Causes(str(folder), chains, tuple(f for f in failures if f.kind in FAILURES and f not in named))


def _chosen(found: Causes, kind: str | None, at_s: float | None) -> Causes:
    """Return the chains of one kind, or the one nearest to a time. Raises Refused when there is none."""
    chains = [chain for chain in found.chains if kind is None or chain.effect.kind == kind]
    if at_s is None:
        return found if kind is None else Causes(found.run, tuple(chains), ())
    near = min(chains, key=lambda chain: abs(chain.effect.at_s - at_s), default=None)
    if near is None or not abs(near.effect.at_s - at_s) <= NEAR_S:
        there = f"no {kind or ' or '.join(EFFECTS)} within {NEAR_S:g} s of it"
        raise Refused(f"--at {at_s:g}: {there}, must be a time that lfa why {found.run} shows")
    return Causes(found.run, (near,), ())


def lines(found: Causes) -> list[str]:
    """Return the chains as plain sentences with times, the root first."""
    texts: list[str] = []
    for chain in found.chains:
        effect = chain.effect
        texts.append(f"{effect.kind} at {effect.at_s:.3f} s: {effect.text}.")
        if chain.root is None:
            texts.append("     no root cause in the journals")
        texts += [_line(fact) for fact in chain.facts[:-1]]
    if not found.chains:
        texts.append(f"{found.run}: no {', '.join(EFFECTS[:-1])} or {EFFECTS[-1]}")
    if found.without_effect:
        texts.append("failures that no leader change, stop, contact or wait followed from:")
        texts += [_line(fact) for fact in found.without_effect]
    return texts


def _line(fact: Fact) -> str:
    proof = f" ({fact.evidence})" if fact.evidence else ""
    return f"  {fact.at_s:9.3f} s  {fact.text}{proof}"


def roots(found: Causes) -> Sequence[Fact]:
    """Return the root of each chain that has one, and the failures without effect, each once, by time."""
    all_roots = {chain.root for chain in found.chains if chain.root is not None} | set(found.without_effect)
    return sorted(all_roots, key=lambda fact: fact.at_s)
