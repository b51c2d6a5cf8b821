"""Terminal views of a running fleet: `lfa watch` and `lfa topic`.

No evaluation of recordings.
"""
