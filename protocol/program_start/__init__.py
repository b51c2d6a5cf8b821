"""What the programs of `lfa` import before anything else: the order of the module search, and a lean msgspec."""
