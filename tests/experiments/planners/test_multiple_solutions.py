"""Several inverse solutions and the choice among them."""

import numpy as np

from s2c2a_experiments.planners.multiple_solutions import best_sequence


def test_the_best_sequence_pays_now_for_what_is_cheap_later():
    """Zero and one [rad]: the near one is free now, and costs much in the next moment."""
    shapes = np.zeros((2, 1, 2))
    shapes[1, 0, 0] = 1.0
    layers = [(shapes, np.array([0.0, 0.5])), (shapes, np.array([5.0, 0.0]))]
    chosen = best_sequence(shapes[0] + 0.4, layers)
    np.testing.assert_array_equal(chosen, [shapes[1], shapes[1]])
