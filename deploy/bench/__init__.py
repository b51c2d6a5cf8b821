"""Measurements: one file a bench name, each row beside its bar or its baseline."""
