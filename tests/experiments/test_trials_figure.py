"""The figure of the trials of a sweep."""

import numpy as np
import pytest

from s2c2a.errors import S2C2AError
from s2c2a_experiments.figures.trials import trials_figure


@pytest.mark.parametrize("rises", [False, True])
def test_scores_are_drawn_over_trials_and_parameters(rises, tmp_path):
    scores = np.array([3.0, 0.1, 2.0])
    values = {"a.b": np.array([1.0, 10.0, 3.0]), "c": np.array([True, False, True])}
    path = tmp_path / "trials.png"
    trials_figure([0, 1, 3], scores, values, "error [cm]", ["a.b"], path, rises)
    assert path.read_bytes().startswith(b"\x89PNG")


def test_a_search_without_finished_trials_is_refused(tmp_path):
    with pytest.raises(S2C2AError, match="no finished trial"):
        trials_figure([], np.array([]), {}, "error [cm]", [], tmp_path / "trials.png")
