"""Processes that run on each machine of a fleet: supervisor, router, and the helper of `lfa up`. No ssh here."""
