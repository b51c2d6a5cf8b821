"""Fleets on several machines: the fleet file, the commands on it, supervisors, routers, ssh and certificates.

No code of agents, lease or world belongs here; each runs as a process that a supervisor starts.
"""
