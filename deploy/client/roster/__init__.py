"""Changes of a running fleet's team, as its operator's side runs them: `lfa join`, `lfa retire`.

What a robot does with them may not live here.
"""
