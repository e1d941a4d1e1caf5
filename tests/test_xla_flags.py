"""Flags of XLA in tests: only those that the installed version knows."""

from xla_flags import known_flags


def test_flags_that_xla_does_not_know_are_left_out():
    known = "--xla_backend_optimization_level=0"
    assert known_flags([known, "--xla_no_such_flag=1"]) == [known]
