"""Commands that an operator sends to a running fleet: `lfa fault`, `lfa forget`, `lfa formation`.

Starting and stopping of fleets, and displays, may not live here.
"""
