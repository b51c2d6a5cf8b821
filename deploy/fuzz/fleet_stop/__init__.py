"""Schedules of the fleet stop alone: what they draw, the team that they are played on, and its player."""
