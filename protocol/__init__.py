"""Messages between processes, the lease protocol that they agree by, and the transport that carries both.

Standard library and msgspec only; no code of agents, simulation or deployment may live here. Only
`transport/zenoh_*.py` import `zenoh` and only `clock.py` imports `time`; all other modules are pure, so that a test, a
simulator or a replay can drive them. `README.md` holds the numbered rules and invariants that code and tests cite.
"""
