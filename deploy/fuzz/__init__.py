"""`lfa fuzz`: drawn fault schedules on simulated leases or complete agents, in virtual time.

The invariant checkers live in `deploy/analysis/verification`; faults on real processes live in `deploy/faults`.
"""
