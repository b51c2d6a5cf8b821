"""Exploration of unknown ground: occupancy grid, costmap, A* search and path smoothing.

No driving along the route (`leading/`). Only explorers import this package: a map and a planner need memory.
"""
