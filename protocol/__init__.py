"""What processes say to each other, agree on, and how it travels.

Standard library and msgspec only. `zenoh_bus.py` alone imports `zenoh`, `clock.py` alone imports
`time`; everything else here is pure and can be driven by a test, a simulator or a replay.
`README.md` holds the numbered rules and invariants that code and tests cite.
"""
