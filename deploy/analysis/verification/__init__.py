"""Checks of the lease's invariants and re-execution of recorded runs (`lfa verify`, `replay`, `map`).

No protocol logic: checkers only observe what processes and gateways published.
"""
