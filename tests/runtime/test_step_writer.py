"""Pieces of a recording make one episode, whatever file they come from."""

import numpy as np
import pytest

from s2c2a.episodes import Episode
from s2c2a.errors import RecordingError
from s2c2a.runtime.step_writer import joined


@pytest.mark.parametrize("sizes", [(10**6, 0), (10**4, 1)])
def test_pieces_that_would_fill_the_memory_are_refused(twin, sizes):
    shapes = (sizes, sizes[::-1])
    pieces = [
        Episode(
            twin,
            {
                "time": np.array([float(number)]),
                "actions": np.zeros((1, 3, 3)),
                "big": np.zeros((1, *shape)),
            },
        )
        for number, shape in enumerate(shapes)
    ]
    with pytest.raises(RecordingError, match="'big' make more than"):
        joined(pieces)
