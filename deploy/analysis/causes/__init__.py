"""Chains of causes in a run (`lfa why`): facts from its journals, recording and event log, and rules that link them.

No cause is read from the `fault` lines of the event log: those are announcements, which a fleet in the field lacks.
"""
