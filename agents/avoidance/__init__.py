"""Obstacle avoidance: decision table, detour, give-way to moving obstacles, ground crossing and the safety limits.

No sensing (`perception/`), no planning on a map (`exploration/`), no recovery from being stuck (`recovery/`).
"""
