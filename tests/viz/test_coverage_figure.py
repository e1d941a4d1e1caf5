"""Figure of the configurations and speeds that a recording contains."""

import jax.numpy as jnp
import numpy as np
import pytest

from s2c2a.episodes import Episode
from s2c2a.kinematics import PCC
from s2c2a.viz import coverage_figure, coverage_image

STEPS = 60


@pytest.fixture
def wandering(make_arm):
    """An episode without states in which all modules bend on a circle, then hold."""

    def make(modules: int) -> Episode:
        angles = 0.1 * np.minimum(np.arange(STEPS), 40)
        circle = 0.3 * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        signs = np.resize([1.0, -1.0], modules)
        bends = jnp.asarray(signs[:, None] * circle[:, None], jnp.float32)
        arm = make_arm(modules)
        cables = np.asarray(PCC.of(arm).actions(bends))
        times = 0.1 * np.arange(STEPS)
        return Episode(arm, {"time": times, "actions": cables, "sensor.cables": cables})

    return make


@pytest.fixture
def axes_of(drawn_figures, tmp_path):
    """Axes of the figure of an episode."""

    def draw(episode):
        coverage_figure([episode], tmp_path / "coverage.png")
        return drawn_figures[-1].axes

    return draw


@pytest.mark.slow
@pytest.mark.parametrize(("modules", "panels"), [(1, 2), (2, 2), (3, 3), (8, 8)])
def test_each_pair_of_neighbors_has_a_panel_and_speeds_have_one(
    wandering, axes_of, modules, panels
):
    axes = axes_of(wandering(modules))
    assert len(axes) == panels
    assert axes[-1].get_xlabel().startswith("speed")


def test_s_shapes_lie_at_the_left_and_their_share_is_stated(wandering, axes_of):
    pair = axes_of(wandering(2))[0]
    places = pair.collections[0].get_offsets()
    assert (places[:, 0] < 0.0).all()
    assert "100 % S" in pair.get_title(loc="left")


def test_holds_are_stated_beside_the_speeds(wandering, axes_of):
    speeds = axes_of(wandering(2))[-1]
    assert "(gray): 32 %" in speeds.get_title(loc="left")


def test_a_figure_is_written_and_an_image_has_colors(wandering, tmp_path):
    path = coverage_figure([wandering(3)], tmp_path / "coverage.png")
    assert path.read_bytes().startswith(b"\x89PNG\r\n")
    pixels = coverage_image([wandering(3)])
    assert pixels.dtype == np.uint8
    assert pixels.shape[2] == 3
    assert pixels.shape[0] > 2 * pixels.shape[1]
    assert np.ptp(pixels) > 200
