"""Following a predecessor: its estimated state, the controller interface, the law and the follower's control step.

No slot geometry (`formation/`), no controllers other than the default law (`controllers/`).
"""
