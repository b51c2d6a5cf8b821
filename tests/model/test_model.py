"""The short form of `make model`: the smallest sizes, quick mutants, the code against the models' rules."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from tests.model import joining, lease_state, lengths, orders, refinement, register_state, roster
from tests.model.__main__ import report
from tests.model.checker import explore, in_columns
from tests.model.fleet_stop import fleet_stop, stop_refinement
from tests.model.runs import MUTANTS, RULES, STATES_MAX, Run


@pytest.mark.parametrize("run", [r for r in RULES if r.short], ids=lambda r: r.name)
def test_no_reachable_state_breaks_an_invariant(run: Run) -> None:
    model = run.model()
    outcome = explore(model, STATES_MAX)
    assert outcome.complete, "\n" + in_columns(model.columns, outcome)


@pytest.mark.parametrize("run", [r for r in MUTANTS if r.short], ids=lambda r: r.mutant)
def test_a_planted_fault_is_caught_with_a_trace(run: Run) -> None:
    model = run.model()
    outcome = explore(model, STATES_MAX)
    assert outcome.violation is not None, f"survived {outcome.states} states: {run.name}"
    assert len(outcome.trace) == outcome.depth


def test_every_mutant_is_planted() -> None:
    assert {run.mutant for run in MUTANTS} == {
        *lease_state.MUTANTS,
        *register_state.MUTANTS,
        *fleet_stop.MUTANTS,
        *roster.MUTANTS,
        *orders.MUTANTS,
        *lengths.MUTANTS,
        *joining.MUTANTS,
    }


def test_make_model_fails_with_a_trace_when_t_grant_is_one_unit_short(capsys: pytest.CaptureFixture[str]) -> None:
    short = next(run for run in MUTANTS if run.mutant == "t_grant_short")
    assert report((short,), ()) == 1
    assert "=> I1: leases 1 and 2 are both valid" in capsys.readouterr().out


def test_make_model_fails_when_a_planted_fault_survives() -> None:
    harmless = next(run for run in RULES if run.short)
    assert report((), (harmless,)) == 1


@pytest.mark.parametrize("compare", [*refinement.ALL, *stop_refinement.ALL], ids=lambda compare: compare.__name__)
def test_the_code_decides_as_the_models_rule(compare: Callable[[], int]) -> None:
    assert compare() > 0
