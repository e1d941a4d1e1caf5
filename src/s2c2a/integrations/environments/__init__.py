"""Gymnasium environments of simulated arms, and policies that were trained in them.

Importing any part of `s2c2a` registers the environments once Gymnasium is loaded
(`s2c2a.execution.after_import`), in either order.
"""
