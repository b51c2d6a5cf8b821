"""Message types of all topics, as frozen msgspec structs, and their codec.

No behaviour and no state may live here: only types, their bounds, and encoding and decoding.
"""
