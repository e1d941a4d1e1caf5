from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure

from s2c2a.errors import S2C2AError
from s2c2a.viz import charts, learning_curves, recording_figure, run_figure
from s2c2a.viz.mounting import ABOVE, SIDE
from s2c2a.viz.reach import _draw_shape

PNG = b"\x89PNG\r\n"
CURVE = np.array([(epoch, 0.5**epoch, 0.6**epoch) for epoch in range(5)])


def is_png(path) -> bool:
    content = path.read_bytes()
    return content.startswith(PNG) and len(content) > 10_000


def test_a_run_without_goals_is_drawn(make_trace, arm, tmp_path, drawn):
    states = make_trace().states
    trace = drawn("$recorded_", np.arange(200.0), states)
    assert is_png(run_figure([trace], arm, tmp_path / "run.png"))


def test_uncounted_steps_are_shaded(make_trace, arm, tmp_path, drawn_figures):
    for counted in (np.arange(200) < 50, None):
        run_figure([make_trace(counted=counted)], arm, tmp_path / "run.png")
    errors = [figure.axes[3] for figure in drawn_figures]
    assert [labels_of(axes).count("not counted") for axes in errors] == [1, 0]
    assert errors[0].patches[0].get_extents().width > 0


def predicted(make_trace, label: str, std: float, width: float = 1.0):
    """A run whose plans lead to its desired path, with a deviation of the tip [m]."""
    trace = make_trace(label)
    states = trace.states.copy()
    states[:, -1, :3] = trace.desired_path
    deviations = np.full((len(states), 3), std)
    deviations[: len(states) // 2] *= width
    return make_trace(label, predicted=states, predictive_std=deviations)


def labels_of(axes) -> list[str]:
    return axes.get_legend_handles_labels()[1]


def test_a_run_figure_shows_twice_the_deviation_of_the_prediction(
    make_trace, arm, tmp_path, drawn_figures
):
    trace = predicted(make_trace, "s2c2a", std=0.01)
    run_figure([make_trace("pcc"), trace], arm, tmp_path / "run.png")
    *coordinates, error, above = drawn_figures[0].axes
    for axes in (*coordinates, error):
        assert labels_of(axes).count("predicted ± 2 std") == 1
    band = error.collections[0].get_paths()[0].get_extents()
    np.testing.assert_allclose([band.y0, band.y1], [0.0, 2.0], atol=1e-6)
    tube = above.collections[0].get_datalim(above.transData)
    widest = np.abs(trace.desired_path[:, 0]).max() + 0.02
    np.testing.assert_allclose([tube.x0, tube.x1], [-widest, widest], atol=1e-3)


def test_a_wide_band_does_not_hide_the_error(make_trace, arm, tmp_path, drawn_figures):
    trace = predicted(make_trace, "s2c2a", std=0.01, width=100.0)
    run_figure([trace], arm, tmp_path / "run.png")
    largest = 100 * trace.position_errors.max()
    assert drawn_figures[0].axes[3].get_ylim()[1] <= 3.01 * largest


@pytest.mark.parametrize("std", [0.0, np.nan])
def test_a_model_without_uncertainty_has_no_band(
    make_trace, arm, tmp_path, drawn_figures, std
):
    run_figure([predicted(make_trace, "pcc", std)], arm, tmp_path / "run.png")
    assert "predicted ± 2 std" not in labels_of(drawn_figures[0].axes[3])


def test_gaps_in_predictions_leave_gaps_in_the_tube(make_trace, arm, tmp_path):
    trace = predicted(make_trace, "s2c2a", std=0.01)
    states = np.array(trace.episode["predicted"])
    states[20:40] = np.nan
    deviations = trace.episode["predictive_std"]
    gap = make_trace("s2c2a", predicted=states, predictive_std=deviations)
    assert is_png(run_figure([gap], arm, tmp_path / "run.png"))


def test_a_run_with_one_step_and_a_gap_in_the_states_is_drawn(
    make_trace, arm, tmp_path, drawn
):
    states = make_trace().states
    single = drawn("single", [0.0], states[:1])
    assert is_png(run_figure([single], arm, tmp_path / "single.png"))
    gap = states.copy()
    gap[20:40] = np.nan
    assert is_png(run_figure([make_trace(states=gap)], arm, tmp_path / "gap.png"))


def test_a_run_of_another_arm_is_refused_and_nothing_is_written(
    make_arm, traces, tmp_path
):
    with pytest.raises(S2C2AError, match="modules"):
        run_figure(traces, make_arm(5), tmp_path / "run.png")
    assert list(tmp_path.iterdir()) == []


def place_in(axes, point) -> np.ndarray:
    """Position of a point on paper, positive to the right and upward."""
    x, y = (
        point["xyz".index(label[0])] for label in (axes.get_xlabel(), axes.get_ylabel())
    )
    return axes.transData.transform((x, y))


def test_a_recording_is_drawn_in_the_mounting_of_its_arm(
    make_arm, make_trace, tmp_path, drawn_figures, mount
):
    gravity, direction = mount
    recording_figure(
        make_trace().states, make_arm(gravity_direction=gravity), tmp_path / "cloud.png"
    )
    side, above = drawn_figures[0].axes
    for axes, expected in ((side, direction), (above, (direction[0], 0))):
        if any(expected):
            tip = place_in(axes, (0.0, 0.0, 0.6)) - place_in(axes, (0.0, 0.0, 0.0))
            np.testing.assert_allclose(tip / np.abs(tip).max(), expected, atol=1e-9)
        else:
            assert "z" not in axes.get_xlabel() + axes.get_ylabel()


@pytest.mark.parametrize("shape", [(10, 6), (10, 3, 3), (0, 3, 6)])
def test_a_recording_of_the_wrong_shape_is_refused(shape, arm, tmp_path):
    with pytest.raises(S2C2AError, match="samples, modules, 6"):
        recording_figure(np.zeros(shape), arm, tmp_path / "cloud.png")


def test_learning_curves_are_drawn(tmp_path):
    curves = {"C2S": CURVE, "C2A": 2.0 * CURVE}
    assert is_png(learning_curves(curves, tmp_path / "curves.png"))


@pytest.mark.parametrize("curves", [{}, {"C2S": np.zeros((0, 3))}])
def test_learning_curves_without_rows_are_refused(curves, tmp_path):
    with pytest.raises(S2C2AError, match="curve"):
        learning_curves(curves, tmp_path / "curves.png")


@pytest.mark.parametrize(
    ("view", "backward", "title", "drawn"),
    [
        (ABOVE, (False, False), "from above", (False, False)),
        (ABOVE, (True, True), "from above", (False, False)),
        (ABOVE, (False, True), "from below", (False, False)),
        (SIDE, (True, False), "side; x runs to the left", (True, False)),
    ],
)
def test_a_plan_is_as_on_paper_and_a_side_says_what_runs_backward(
    view, backward, title, drawn
):
    figure = charts.new_figure(3.0, 3.0)
    mounting = SimpleNamespace(flat=lambda view: (view, backward))
    place = figure.add_gridspec(1, 1)[0]
    axes, _ = charts.titled_view(figure, place, mounting, view, "side")
    assert (axes.xaxis_inverted(), axes.yaxis_inverted()) == drawn
    assert axes.get_title("left") == title


def test_an_obstacle_that_appears_later_is_in_the_figure_of_a_run(
    make_trace, arm, tmp_path, drawn_figures
):
    obstacles = np.full((len(make_trace().times), 1, 4), np.nan)
    obstacles[5:] = [0.2, 0.0, 0.3, 0.05]
    run_figure([make_trace(obstacles=obstacles)], arm, tmp_path / "run.png")
    above = drawn_figures[-1].axes[-1]
    assert len(above.patches) == 1
    (label,) = [text for text in above.texts if text.get_text() == "from 0.5 s"]
    assert label.get_zorder() > max(line.get_zorder() for line in above.lines)
    assert label.get_bbox_patch() is not None


def test_the_legend_of_a_map_shows_colors_that_are_drawn(arm):
    axes = Figure().add_subplot()
    heights = np.cumsum([module.length for module in arm.modules])
    states = np.zeros((1, arm.module_count, 6))
    states[0, :, 2] = heights
    states[..., 5] = 1.0
    reached = SimpleNamespace(states=states, position_errors=np.zeros(1))
    _draw_shape(axes, arm, reached, SIDE)
    drawn = {line.get_color() for line in axes.lines if len(line.get_xdata())}
    handles, _ = axes.get_legend_handles_labels()
    assert {handle.get_label() for handle in handles} == {"nearest shape", "base"}
    assert {handle.get_color() for handle in handles} <= drawn


@pytest.mark.parametrize("width", [5.0, 7.6])
def test_a_legend_of_many_names_stays_within_its_figure(width):
    figure = charts.new_figure(width, 4.0)
    axes = charts.new_axes(figure, figure.add_gridspec(1, 1)[0], "", "")
    for number in range(9):
        axes.plot([0, 1], label=f"strategy {number}   {number}.00 ± 0.00 cm")
    charts.legend(figure)
    figure.draw_without_rendering()
    box = figure.legends[0].get_window_extent()
    assert box.x0 >= 0
    assert box.x1 <= figure.bbox.x1
    assert box.y0 >= axes.get_window_extent().y1
