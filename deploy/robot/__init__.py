"""Driver of a real robot: it publishes the hardware topics and embeds the gateway, as the simulated world does.

Needs the base install only; no simulation code may live here.
"""
