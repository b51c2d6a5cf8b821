"""Courses, movers and maps that `lfa bench motion` drives a team through, and what becomes of its runs.

Nothing here may import a bench; what a course consists of is data in a table.
"""
