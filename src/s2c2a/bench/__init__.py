"""Benchmarks: how fast everything is on this machine, as medians, 99th percentiles and ratios within one run."""
