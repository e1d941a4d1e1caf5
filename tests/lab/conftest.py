"""Puts the helpers of this folder on the path of all tests below it."""
