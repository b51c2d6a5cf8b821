"""Formation geometry: slots, their motion, kinematics of the paper's equations, and the predecessor's pose history.

No control law (`following/`), no decision when to change the formation (`leading/`).
"""
