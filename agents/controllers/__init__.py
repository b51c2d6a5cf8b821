"""Alternative follower controllers for comparison with `Law`, found through the entry points `lfa.controllers`.

The default law may not live here (`following/controller.py`), nor what all controllers share (`following/follower.py`).
"""
