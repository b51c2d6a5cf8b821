"""Worlds of other programs: read into a scenario (`lfa import`), and written for them (`lfa export sdf`, `map`).

A reader for each format turns a file into a `WorldDrawing`; `fitting.py` finds a way through it and makes the scenario.
"""
