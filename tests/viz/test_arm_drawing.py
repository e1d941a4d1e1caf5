import numpy as np
import pytest

from s2c2a.arm import ArmSpec, load_arm, preset_names
from s2c2a.viz import arm_figure
from s2c2a.viz.arm_drawing import SideView, kinds_of_module, spread


@pytest.mark.parametrize(("modules", "cables"), [(1, 3), (3, 4), (20, 8)])
def test_arms_of_any_size_are_drawn(make_arm, modules, cables, tmp_path):
    path = arm_figure(make_arm(modules, cables), tmp_path / "arm.png")
    assert path.stat().st_size > 20_000


@pytest.mark.parametrize("name", preset_names())
def test_every_preset_is_drawn(name, tmp_path):
    assert arm_figure(load_arm(name), tmp_path / "arm.png").stat().st_size > 20_000


@pytest.mark.parametrize(
    "gravity", [(0, 0, 1), (0, 0, 0), (1, 0, 0), (0, 1, 0), (0, -1, 0), (0.6, 0, -0.8)]
)
def test_gravity_is_drawn_in_any_direction(make_arm, gravity, tmp_path):
    arm = make_arm(gravity_direction=gravity, description="costs $5 to $6, " * 20)
    assert arm_figure(arm, tmp_path / "arm.png").stat().st_size > 20_000


def test_modules_with_equal_cable_arrangements_share_a_cross_section(make_module):
    turned = make_module(cable_angles_deg=(60.0, 180.0, 300.0))
    modules = (make_module(3), turned, make_module(3))
    arm = ArmSpec(name="mixed", actuation="displacement", modules=modules)
    assert list(kinds_of_module(arm).items()) == [("A", [1, 3]), ("B", [2])]


def test_twenty_kinds_of_module_get_twenty_cross_sections(make_module, tmp_path):
    modules = tuple(make_module(3, cable_radius=0.02 + 0.001 * k) for k in range(20))
    arm = ArmSpec(name="many", actuation="displacement", modules=modules)
    assert len(kinds_of_module(arm)) == 20
    assert arm_figure(arm, tmp_path / "arm.png").stat().st_size > 20_000


SIZE = np.array([2.9, 4.2])
MOUNTS = [
    ((0, 0, -1), (0, 1)),
    ((0, 0, 0), (0, 1)),
    ((0, 0, 1), (0, -1)),
    ((1, 0, 0), (1, 0)),
    ((0, 0.8, -0.6), (1, 0)),
]


@pytest.mark.parametrize(("gravity", "direction"), MOUNTS)
def test_the_side_view_shows_the_whole_mounted_arm_to_scale(
    make_arm, gravity, direction
):
    arm = make_arm(gravity_direction=gravity)
    view = SideView.of(arm, SIZE[1])
    base, tip = view.at([0.0, arm.length])
    np.testing.assert_allclose(
        tip - base, np.array(direction) * arm.length / view.per_inch, atol=1e-9
    )
    corners = view.at(
        [0.0, 0.0, arm.length, arm.length], 0.027 * np.array([-1, 1, -1, 1])
    )
    assert (corners > 0).all()
    assert (corners < SIZE).all()
    np.testing.assert_allclose(
        np.linalg.norm(corners[1] - corners[0]) * view.per_inch, 2 * 0.027
    )


def test_rows_are_spread_within_the_table_and_keep_their_order():
    rows = spread(np.array([0.10, 0.11, 0.12, 0.97, 0.99]), 0.1)
    assert np.diff(rows).min() > 0.1 - 1e-9
    assert rows[0] >= 0.05
    assert rows[-1] <= 0.95 + 1e-9
