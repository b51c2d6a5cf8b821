"""HTML report about one run or two. `uplot/` is uPlot 1.6.32, under its own licence, MIT.

No figures of its own and no evaluation: they come from `deploy/view/figures` and `deploy/analysis`.
"""
