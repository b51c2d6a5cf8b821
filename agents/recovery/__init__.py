"""Recovery: detection that a robot is stuck, and backing up out of a place.

No decision about the lease or the chain (`stuck_policy.py`), no avoidance while driving on (`avoidance/`).
"""
