"""Figures that answer the paper's."""

import struct
from functools import partial

import numpy as np
import pytest

from s2c2a.errors import S2C2AError
from s2c2a.obstacles import HALF_SPACE
from s2c2a.viz import Trace
from s2c2a.viz.charts import legend, new_axes, new_figure
from s2c2a_experiments.figures.space import (
    _held_position,
    obstacles_figure,
    plan_view_figure,
    poses_figure,
)
from s2c2a_experiments.figures.time import (
    _azimuth_like_desired,
    _nearest_obstacle,
    coordinates_figure,
    estimation_figure,
    interaction_figure,
    orientation_figure,
)

from marks import slow_after

TIMES = np.arange(50) / 10


def interaction_of(named, path):
    return interaction_figure(named["task"], named["task"], path)


def listed(draw, named, path):
    return draw(list(named.values()), path)


OF_TASKS = [
    plan_view_figure,
    poses_figure,
    obstacles_figure,
    interaction_of,
    partial(listed, coordinates_figure),
    partial(listed, orientation_figure),
]
OF_OBSTACLES = OF_TASKS[:4]
every_figure = pytest.mark.parametrize("draw", OF_TASKS)
every_figure_of_obstacles = pytest.mark.parametrize("draw", OF_OBSTACLES)


def is_sensible_png(path) -> bool:
    content = path.read_bytes()
    width, height = struct.unpack(">II", content[16:24])
    return (
        content.startswith(b"\x89PNG\r\n")
        and 600 <= width <= 3000
        and 200 <= height <= 3000
    )


def many(trace: Trace, count: int) -> dict[str, Trace]:
    return {f"task {number}": trace for number in range(count)}


@every_figure
@pytest.mark.parametrize(
    "modules", [1, *(pytest.param(count, marks=pytest.mark.slow) for count in (3, 7))]
)
def test_a_run_of_any_number_of_modules_is_drawn_into_a_folder_that_is_made(
    draw, modules, make_trace, tmp_path
):
    path = tmp_path / "new" / "figure.png"
    assert draw({"task": make_trace(modules=modules)}, path) == path
    assert is_sensible_png(path)


@every_figure
@pytest.mark.parametrize(
    "unseen", [slice(0, 20), pytest.param(slice(None), marks=pytest.mark.slow)]
)
def test_a_run_that_was_not_seen_for_a_while_or_ever_is_drawn(
    draw, unseen, make_trace, tmp_path, drawn
):
    states = make_trace().states.copy()
    states[unseen] = np.nan
    assert is_sensible_png(
        draw({"task": make_trace(states=states)}, tmp_path / "figure.png")
    )


@pytest.mark.slow
@every_figure_of_obstacles
def test_a_box_and_a_wall_are_drawn(draw, make_trace, tmp_path):
    unturned = [0.0, 0.0, 0.0, 1.0]
    box = [0.3, 0.0, 0.5, 0.01, *unturned, 0.1, 0.05, 0.05, 0.0]
    edges = [HALF_SPACE, HALF_SPACE, HALF_SPACE]
    wall = [-0.5 - HALF_SPACE, 0.0, 0.0, 1e-4, *unturned, *edges, 0.0]
    trace = make_trace(obstacles=np.tile([box, wall], (200, 1, 1)))
    assert is_sensible_png(draw({"task": trace}, tmp_path / "figure.png"))
    distances, _ = _nearest_obstacle(trace)
    assert np.isfinite(distances).all()


@pytest.mark.parametrize(
    "draw", slow_after(1, [plan_view_figure, poses_figure, obstacles_figure])
)
def test_each_task_has_its_panel(draw, make_trace, tmp_path):
    assert is_sensible_png(draw(many(make_trace(), 5), tmp_path / "figure.png"))


@pytest.mark.parametrize("draw", [plan_view_figure, poses_figure, obstacles_figure])
def test_no_task_is_refused(draw, tmp_path):
    with pytest.raises(S2C2AError, match="no trace"):
        draw({}, tmp_path / "figure.png")


@pytest.mark.slow
def test_runs_of_one_task_lie_over_each_other(traces, tmp_path):
    assert is_sensible_png(
        obstacles_figure({"reach": traces, "alone": traces[0]}, tmp_path / "figure.png")
    )
    assert is_sensible_png(coordinates_figure(traces, tmp_path / "coordinates.png"))
    assert is_sensible_png(orientation_figure(traces, tmp_path / "orientation.png"))


def test_runs_that_the_legend_cannot_tell_apart_are_refused(make_trace, tmp_path):
    twice = [make_trace(), make_trace()]
    for draw in (coordinates_figure, orientation_figure):
        with pytest.raises(S2C2AError, match="several traces are labeled 's2c2a'"):
            draw(twice, tmp_path / "figure.png")
    with pytest.raises(S2C2AError, match="several traces are labeled 's2c2a'"):
        obstacles_figure({"reach": twice}, tmp_path / "figure.png")


def test_no_run_is_refused(tmp_path):
    for draw in (coordinates_figure, orientation_figure):
        with pytest.raises(S2C2AError, match="no trace"):
            draw([], tmp_path / "figure.png")
    with pytest.raises(S2C2AError, match="no trace"):
        obstacles_figure({"reach": []}, tmp_path / "figure.png")


@pytest.mark.parametrize("angles", [np.sin(TIMES), np.full(50, np.nan)])
def test_estimated_angles_are_drawn_beside_true_ones_wherever_these_are_known(
    angles, tmp_path
):
    assert is_sensible_png(
        estimation_figure(TIMES, angles, np.cos(TIMES), tmp_path / "new" / "figure.png")
    )


@pytest.mark.parametrize("shapes", [(50, 50, 49), (0, 0, 0), ((5, 1), (5, 1), (5, 1))])
def test_angles_that_do_not_fit_together_are_refused(shapes, tmp_path):
    with pytest.raises(S2C2AError, match="same shape"):
        estimation_figure(*map(np.zeros, shapes), tmp_path / "figure.png")


def test_a_true_azimuth_stays_within_half_a_turn_of_the_desired_one_over_several_turns(
    make_trace,
):
    around = np.linspace(0, 6 * np.pi, 200)
    desired = np.stack(
        [np.cos(around), np.sin(around), np.ones(200)], axis=-1
    ) / np.sqrt(2)
    states, axes = make_trace().states.copy(), np.full((200, 3, 3), np.nan)
    states[:, -1, 3:], axes[:, -1] = desired, desired
    azimuth = _azimuth_like_desired(make_trace(states=states, desired_axes=axes))
    np.testing.assert_allclose(azimuth, np.rad2deg(around), atol=1e-6)


def test_the_azimuth_of_an_upright_axis_is_left_out(make_trace):
    upright = np.zeros((200, 3, 6))
    upright[..., 5] = 1.0
    assert np.isnan(_azimuth_like_desired(make_trace(states=upright))).all()


def test_the_held_end_is_the_one_that_should_move_least_and_little(make_trace):
    desired = make_trace().desired_positions.copy()
    assert _held_position(desired, 0.6) is None
    desired[:, 0] = [0.0, 0.0, 0.2]
    np.testing.assert_array_equal(_held_position(desired, 0.6), [0.0, 0.0, 0.2])
    assert _held_position(np.full_like(desired, np.nan), 0.6) is None


def test_the_nearest_obstacle_is_the_one_whose_threshold_is_nearest(make_trace):
    states = np.zeros((200, 3, 6))
    obstacles = np.tile(
        [[0.3, 0.0, 0.0, 0.1], [0.5, 0.0, 0.0, 0.4], [0.01, 0.0, 0.0, -1.0]],
        (200, 1, 1),
    )
    distances, thresholds = _nearest_obstacle(
        make_trace(states=states, obstacles=obstacles)
    )
    np.testing.assert_allclose([distances, thresholds], np.tile([[0.5], [0.4]], 200))


@pytest.mark.parametrize("width", [5.0, 7.6])
def test_a_legend_of_many_names_stays_within_its_figure(width):
    figure = new_figure(width, 4.0)
    axes = new_axes(figure, figure.add_gridspec(1, 1)[0], "", "")
    for number in range(9):
        axes.plot([0, 1], label=f"strategy {number}   {number}.00 ± 0.00 cm")
    legend(figure)
    figure.draw_without_rendering()
    box = figure.legends[0].get_window_extent()
    assert box.x0 >= 0
    assert box.x1 <= figure.bbox.x1
    assert box.y0 >= axes.get_window_extent().y1


def test_a_folder_that_cannot_be_made_is_refused(make_trace, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(S2C2AError, match="cannot write"):
        coordinates_figure([make_trace()], tmp_path / "file" / "figure.png")
