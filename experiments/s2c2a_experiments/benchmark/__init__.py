"""Every planner of the paper's Table I on the same arms and tasks: `s2c2a benchmark`."""
