"""Forms of `s2c2a export` for other ecosystems; entry points of `s2c2a.exports`."""
