"""Merged campaigns: the results of all shares as one table, as files, and as one page."""
