"""Operator side: the `lfa` command and the tools that start, observe, record, analyse and verify a fleet.

May import every other package, and none of them may import this one. Heavy libraries are imported inside the command
that needs them.
"""
