"""Shared tools of the benches: rows with bars, live teams, the bare chain, child processes. No bench may live here."""
