"""Localization: own pose from odometry and fixes, its covariance, clock offsets and plausibility bounds.

No sensing of obstacles (`perception/`), no estimate of the predecessor (`following/`).
"""
