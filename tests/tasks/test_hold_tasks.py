"""Tasks that hold one module's end: targets by hand from docs/results/protocol.md."""

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.errors import TargetError
from s2c2a.tasks import load_task
from tilted import axis

TWIN = load_arm("twin_arm")
TURNING = [("hold-middle", 1, 0.4, 0.396, 20), ("hold-end", 2, 0.6, 0.565, 40)]


def arm_of(modules):
    return TWIN.model_copy(update={"modules": (TWIN.modules[0],) * modules})


def desired(name, module, arm=TWIN):
    """Positions and axes of a module's end."""
    task = load_task(name, arm)
    return task.desired_positions()[:, module], task.desired_axes()[:, module]


def test_the_base_module_stays_where_it_is_at_rest():
    positions, axes = desired("hold-base", 0)
    np.testing.assert_allclose(positions, np.tile([0, 0, 0.2], (200, 1)), atol=1e-7)
    assert np.isnan(axes).all()


def test_over_a_held_base_the_tip_goes_once_around_counterclockwise():
    positions, _ = desired("hold-base", -1)
    points = [[0.15, 0, 0.56], [0, 0.15, 0.56], [-0.15, 0, 0.56], [0.15, 0, 0.56]]
    np.testing.assert_allclose(positions[[39, 79, 119, 199]], points, atol=1e-6)


@pytest.mark.parametrize(("name", "module", "rest", "height", "tilt"), TURNING)
def test_a_held_end_sinks_along_the_axis_over_forty_steps_and_stays(
    name, module, rest, height, tilt
):
    positions, _ = desired(name, module)
    shares = np.append(np.arange(1, 41) / 40, np.ones(160))
    np.testing.assert_array_equal(positions[:, :2], 0)
    heights = rest + (height - rest) * shares
    np.testing.assert_allclose(positions[:, 2], heights, atol=1e-6)


@pytest.mark.parametrize(("name", "module", "rest", "height", "tilt"), TURNING)
@pytest.mark.parametrize(
    ("step", "share", "azimuth"),
    [(1, 1 / 40, 0), (20, 0.5, 0), (40, 1, 0), (80, 1, 90), (160, 1, 270), (200, 1, 0)],
)
def test_the_axis_of_a_held_end_tilts_and_then_goes_once_round(
    name, module, rest, height, tilt, step, share, azimuth
):
    _, axes = desired(name, module)
    np.testing.assert_allclose(axes[step - 1], axis(tilt * share, azimuth), atol=1e-6)


@pytest.mark.parametrize(
    ("name", "modules"),
    [("hold-base", 1), ("hold-middle", 1), ("hold-middle", 2), ("hold-end", 1)],
)
def test_an_arm_with_too_few_modules_is_rejected(name, modules):
    told = rf"'{name}' needs .* at least \d modules, 'twin_arm' has {modules}"
    with pytest.raises(TargetError, match=told):
        load_task(name, arm_of(modules))


@pytest.mark.parametrize(("modules", "middle"), [(3, 1), (4, 1), (5, 2), (6, 2)])
def test_the_middle_module_is_the_lower_one_of_two_where_the_number_is_even(
    modules, middle
):
    positions = load_task("hold-middle", arm_of(modules)).desired_positions()
    assert np.flatnonzero(np.isfinite(positions[0, :, 0])).tolist() == [middle]
    assert positions[-1, middle, 2] == pytest.approx(0.99 * 0.2 * (middle + 1))


def test_a_module_of_another_length_is_held_where_it_ends():
    module = TWIN.modules[0]
    modules = [module.model_copy(update={"length": 0.1 * each}) for each in (1, 2, 3)]
    arm = TWIN.model_copy(update={"modules": tuple(modules)})
    for name, place, height in (("base", 0, 0.1), ("middle", 1, 0.3 * 0.99)):
        positions, _ = desired(f"hold-{name}", place, arm)
        np.testing.assert_allclose(positions[-1], [0, 0, height], atol=1e-7)
