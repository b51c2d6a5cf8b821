"""Evaluation of recorded runs: tracking errors, summaries, assertions, and checks.

No running fleet and no drawing: they are in `deploy/client` and `deploy/view`.
"""
