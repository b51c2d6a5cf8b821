"""Perception: scan points, ground profiles and maps, tracked obstacles and those reported by other robots.

No decision about what to do (`avoidance/`), no map for planning (`exploration/`).
"""
