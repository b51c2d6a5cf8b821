"""One robot: team state, lease, perception, control, limits and telemetry.

Imports `protocol` and the base install (msgspec, typer) only: an agent starts without numpy, pymunk or rerun, and its
only input from the world is its own hardware topics.
"""
