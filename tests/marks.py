"""Marks of parameters."""

from collections.abc import Iterable

import pytest


def slow_after(count: int, values: Iterable) -> list:
    """The values, of which all but the first are slow tests.

    `make test` tries the first ones, which say that the kind works; `make test-all`
    tries all.
    """
    quick, others = list(values)[:count], list(values)[count:]
    return [
        *quick,
        *(
            pytest.param(
                *(each if isinstance(each, tuple) else (each,)), marks=pytest.mark.slow
            )
            for each in others
        ),
    ]
