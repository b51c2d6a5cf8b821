"""Sensor models of the simulated robots: exact measurements in batch, and their noise.

No body dynamics and no publishing of messages may live here.
"""
