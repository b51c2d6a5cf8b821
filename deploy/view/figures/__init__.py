"""Figures of a recorded run, drawn with matplotlib.

No computation of errors or episodes: that is in `deploy/analysis`.
"""
