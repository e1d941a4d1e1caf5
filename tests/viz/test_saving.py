import pytest
from matplotlib.figure import Figure

from s2c2a.errors import S2C2AError
from s2c2a.viz.charts import save_figure


def test_a_figure_that_fails_to_draw_leaves_nothing_behind(tmp_path):
    figure = Figure()
    figure.text(0.5, 0.5, r"$\nonsense$")
    with pytest.raises(ValueError, match="nonsense"):
        save_figure(figure, tmp_path / "figure.png")
    assert list(tmp_path.iterdir()) == []


def test_an_unknown_figure_format_is_refused(tmp_path):
    with pytest.raises(S2C2AError, match=r"not in '\.doc'"):
        save_figure(Figure(), tmp_path / "figure.doc")
