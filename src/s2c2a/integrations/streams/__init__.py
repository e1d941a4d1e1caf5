"""Streams of control steps to viewers; entry points of `s2c2a.streams`."""
