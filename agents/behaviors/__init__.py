"""Behaviours of a robot: each turns what is seen and decided into the wanted twist of one role, and owns its state.

No decision about obstacles (`avoidance/`), no limits: the navigator applies them once, to whatever a behaviour wants.
"""
