"""HTML report about one run or two.

No figures of its own and no evaluation: they come from `deploy/view/figures` and `deploy/analysis`.
"""
