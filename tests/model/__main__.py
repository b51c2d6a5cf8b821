"""`make model`: every model at its size, every mutant until it is caught. Exit code 1 on a violation or a survivor."""

from __future__ import annotations

import sys
from time import process_time

from tests.model import refinement
from tests.model.checker import Outcome, explore, in_columns
from tests.model.fleet_stop import stop_refinement
from tests.model.runs import MUTANTS, RULES, STATES_MAX, Run


def report(rules: tuple[Run, ...], mutants: tuple[Run, ...]) -> int:
    """Print what each run found; answers the exit code."""
    began, failed, states = process_time(), 0, 0
    print("The rules as they are: every reachable state")
    for run in rules:
        outcome, text = _explored(run)
        states += outcome.states
        _say(run, outcome, "holds" if outcome.complete else "FAILS")
        if not outcome.complete:
            failed += 1
            print(text if outcome.violation else "not complete: too many states", flush=True)
    print("\nPlanted faults: each must be caught, as short as it can be shown")
    for run in mutants:
        outcome, text = _explored(run)
        states += outcome.states
        _say(run, outcome, f"caught in {outcome.depth} steps" if outcome.violation else "SURVIVES")
        failed += outcome.violation is None
        if run.mutant == "t_grant_short" and outcome.violation:
            print(text, flush=True)
    print("\nThe code of protocol/ against the models' rules")
    for compare in (*refinement.ALL, *stop_refinement.ALL):
        print(f"{compare():10,} comparisons  {compare.__name__}", flush=True)
    print(f"\n{states:,} states, {process_time() - began:.0f} s of one core: {'FAILED' if failed else 'ok'}")
    return 1 if failed else 0


def _explored(run: Run) -> tuple[Outcome, str]:
    model = run.model()
    outcome = explore(model, STATES_MAX)
    return outcome, in_columns(model.columns, outcome) if outcome.violation else ""


def _say(run: Run, outcome: Outcome, verdict: str) -> None:
    kind = outcome.violation.split(":")[0] + ": " if outcome.violation else ""
    print(
        f"{outcome.states:10,} states {outcome.depth:3} deep {outcome.seconds:6.1f} s  {kind}{run.name}: {verdict}",
        flush=True,
    )


if __name__ == "__main__":
    sys.exit(report(RULES, MUTANTS))
