"""Motion of the simulated bodies: wheel drive, kinematic model, rigid bodies, wheel-ground contact.

No sensors, gateways or messages may live here.
"""
