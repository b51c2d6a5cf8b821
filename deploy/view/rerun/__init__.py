"""Conversion of a recording or a running fleet to entities of the rerun viewer.

The only package that may import rerun.
"""
