"""One robot: beliefs, lease, behaviour, limits, and what it says.

Imports `protocol` and the base install (msgspec, typer) only: an agent starts without numpy, pymunk or
rerun, and knows of the world nothing but what its own hardware topics say.
"""
