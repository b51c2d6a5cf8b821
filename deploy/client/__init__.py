"""Client side of a running fleet: discovery, subscription, operator messages, and the state shown to people.

No commands (`lfa ...`), terminal output or process control may live here.
"""
