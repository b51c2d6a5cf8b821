"""Views of a run folder or a running fleet for people: terminal, rerun viewer, figures, report.

No control and no evaluation: nothing here may be imported by a control loop, and numbers come from `deploy/analysis`.
"""
