"""Checks of recorded runs against the paper's figures (control.md 7.1) for `lfa verify`.

No drawing and no checks of lease invariants: they are in `deploy/view/figures` and `deploy/analysis/verification`.
"""
