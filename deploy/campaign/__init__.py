"""Campaigns: many independent items of work, each named by its hash, done in shares, resumed and merged.

What an item is, a run of a plan, a chunk of fuzz schedules or a case of a bench, is the business of the rooms that use
this one.
"""
