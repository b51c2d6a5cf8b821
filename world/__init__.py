"""Simulation: bodies, ground, sensors, actuator gateways and virtual time.

May import `protocol`, numpy and pymunk; no code of agents, deployment or analysis may live here. The world communicates
with an agent only through the topics that the robot's own hardware would use.
"""
