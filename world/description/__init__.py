"""Description of a scenario: its types, loading from TOML, checks, and random variations.

No simulation and no import of the physics engine may live here: a launcher reads a scenario in milliseconds.
"""
