"""Benchmarks: one module per bench name, each row beside its bar or baseline. Product code may not live or import here."""
