"""Commands `s2c2a import` and `s2c2a identify`."""
