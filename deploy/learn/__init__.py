"""Environments for learners: a simulated team in which a policy commands some robots and the others drive as always.

`lfa.deploy.simulate.environment` makes them; they need the extra `learn`.
"""
