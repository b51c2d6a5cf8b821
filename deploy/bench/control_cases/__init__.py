"""Cases and figures of `lfa bench control`: string stability, table of control.md, complete agents.

Running and printing the rows belongs to `bench/control.py` and `bench/harness/rows.py`, not here.
"""
