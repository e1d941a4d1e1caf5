"""Figure of the measured ends of a log."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from s2c2a.logs import measured_ends
from s2c2a.logs.measured_ends import RowMark, measured_ends_figure
from s2c2a.measurements.outliers import MeasuredEnds, Outliers

ROWS = 60


@pytest.fixture
def drawn(monkeypatch, tmp_path):
    """Draw two ends in two logs; returns the figure."""
    kept: list[Figure] = []
    monkeypatch.setattr(
        measured_ends, "save_figure", lambda figure, path: kept.append(figure)
    )
    positions = np.sin(0.1 * np.arange(ROWS))[:, None, None] * np.ones((1, 2, 3))
    ends = MeasuredEnds(
        np.zeros((ROWS, 3)), positions, positions, np.repeat([0, 1], ROWS // 2)
    )
    none = np.zeros((ROWS, 2), bool)
    frozen = none.copy()
    frozen[10:15, 1] = True
    jumps = none.copy()
    jumps[40, 0] = True
    outliers = Outliers(frozen, jumps, none, none, ~none)
    mark = RowMark(50, "jump of the frame")
    measured_ends_figure(ends, (0, 1), outliers, [mark], ["a note"], tmp_path / "a.png")
    return kept[0]


def test_every_end_has_its_exclusions_and_all_have_marks_borders_and_notes(drawn):
    first, second = drawn.axes
    assert first.get_title(loc="left") == "end of module 1"
    assert second.get_title(loc="left") == "end of module 2"
    assert second.get_xlabel() == "row\na note"
    for axes in drawn.axes:
        lines = axes.get_lines()
        assert len([line for line in lines if line.get_label() in "xyz"]) == 3
        assert {29.5, 50} <= {line.get_xdata()[0] for line in lines}
    # frozen rows are a band, other excluded poses crosses
    assert not first.patches
    (band,) = second.patches
    assert band.get_x() == 9.5
    assert band.get_x() + band.get_width() == 14.5
    crosses = [line for line in first.get_lines() if line.get_marker() == "x"]
    assert {tuple(line.get_xdata()) for line in crosses} == {(40,)}


def test_a_figure_of_a_log_without_exclusions_is_written(tmp_path):
    ends = MeasuredEnds(
        np.zeros((5, 3)), np.zeros((5, 1, 3)), np.zeros((5, 1, 3)), np.zeros(5, int)
    )
    path = measured_ends_figure(ends, (2,), None, [], [], tmp_path / "b.png")
    assert path.stat().st_size > 1000
