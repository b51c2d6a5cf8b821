"""Everything that is simulated: bodies, ground, sensors, weather, virtual time.

Imports `protocol`, numpy and pymunk; never `agents`. A world speaks to a robot only in the words that the
robot's own hardware would use.
"""
