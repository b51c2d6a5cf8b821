"""Searches for schedules that violate an invariant: drawn, systematic and guided ones, and their command."""
