"""Strict reading of files written by a person: all mistakes of a file at once, each with its line.

No scenario, fleet or mission is known here; the rooms that own these types pass them and their rules.
"""
