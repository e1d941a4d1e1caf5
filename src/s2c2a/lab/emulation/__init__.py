"""Emulated servos of a real arm, on a pseudo-terminal, with the arm's physics behind.

The packets are written from the manuals and share no code with `s2c2a.lab.hardware`, so
that one tests the other.
"""
