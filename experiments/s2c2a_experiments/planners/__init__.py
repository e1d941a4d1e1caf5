"""The planners of the paper's Table I, each a strategy in a file of its own.

They are chosen by name, as `--strategy rrt-star`, and compared by `s2c2a benchmark`.
"""
