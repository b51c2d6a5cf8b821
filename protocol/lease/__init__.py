"""The lease protocol: quorum, voter, candidate, holder, witness and the actuator gateway, as pure state machines.

No clock, no socket, no randomness and no code of a particular robot may live here.
"""
