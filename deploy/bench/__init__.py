"""Benchmarks: one module per bench name, each row beside its bar or baseline.

No code that a running fleet needs may live here.
"""
