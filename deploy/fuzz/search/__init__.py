"""Searches for schedules that violate an invariant: drawn, lagging, systematic and guided ones, and their command."""
