"""`lfa sim` and `lfa run`: a scenario in virtual time or as processes on this machine, from start to verdict.

Fault scripts live in `deploy/faults`, recordings in `deploy/recording`, evaluation in `deploy/analysis`.
"""
