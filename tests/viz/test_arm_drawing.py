import numpy as np
import pytest

from s2c2a.arm import load_arm, preset_names
from s2c2a.viz import arm_figure
from s2c2a.viz.arm_drawing import kinds_of_module


@pytest.mark.parametrize("name", preset_names())
def test_every_preset_is_drawn(name, tmp_path):
    assert arm_figure(load_arm(name), tmp_path / "arm.png").stat().st_size > 20_000


def test_modules_with_equal_cable_arrangements_share_a_cross_section(arm):
    first, second, third = arm.modules
    turned = second.model_copy(update={"cable_angles_deg": (60.0, 180.0, 300.0)})
    mixed = arm.model_copy(update={"modules": (first, turned, third)})
    assert list(kinds_of_module(mixed).items()) == [("A", [1, 3]), ("B", [2])]


def test_the_drawing_shows_the_radius_of_the_body(arm, side_of):
    first, second, third = arm.modules
    thick = second.model_copy(update={"radius": 0.06})
    side = side_of(arm.model_copy(update={"modules": (first, thick, third)}))
    _, *bodies = [np.ptp(patch.get_xy(), axis=0)[0] for patch in side.patches]
    np.testing.assert_allclose(bodies, [0.054, 0.12, 0.054])
    table, usual, of_thick = side.figure.axes[3:]
    (cells,) = [drawn.get_celld() for drawn in table.tables]
    column = next(
        place
        for (row, place), cell in cells.items()
        if not row and cell.get_text().get_text().startswith("body")
    )
    texts = [cells[row, column].get_text().get_text() for row in (1, 2, 3)]
    assert texts == ["0", "60", "0"]
    assert usual.patches[0].radius == pytest.approx(1.22)
    assert of_thick.patches[0].radius == pytest.approx(60 / 27)


@pytest.mark.parametrize("radius", [0.0, 0.02, 0.06, 0.09, 0.5])
def test_a_section_shows_the_whole_body_with_the_angles_outside(
    make_arm, drawn_figures, tmp_path, radius
):
    arm = make_arm()
    modules = tuple(one.model_copy(update={"radius": radius}) for one in arm.modules)
    arm_figure(arm.model_copy(update={"modules": modules}), tmp_path / "arm.png")
    section = drawn_figures[-1].axes[-1]
    body, *_ = (patch.radius for patch in section.patches if hasattr(patch, "radius"))
    box = section.viewLim
    assert body < min(*box.max, *-box.min)
    angles = [text for text in section.texts if "°" in text.get_text()]
    assert len(angles) == 3
    for text in angles:
        x, y = text.get_position()
        assert max(body, 1.0) < np.hypot(x, y)
        assert abs(x) < box.max[0]
        assert abs(y) < box.max[1]


@pytest.fixture
def side_of(drawn_figures, tmp_path):
    """Axes of the side view of an arm, laid out."""

    def draw(arm):
        arm_figure(arm, tmp_path / "arm.png")
        drawn_figures[-1].draw_without_rendering()
        return drawn_figures[-1].axes[2]

    return draw


def test_the_side_view_shows_the_whole_mounted_arm_to_scale(make_arm, side_of, mount):
    gravity, direction = mount
    side = side_of(make_arm(gravity_direction=gravity))
    base, *modules = [patch.get_xy() for patch in side.patches]
    np.testing.assert_allclose(
        modules[-1].mean(axis=0) - modules[0].mean(axis=0), 0.4 * np.array(direction)
    )
    np.testing.assert_allclose(np.ptp(modules[0], axis=0) @ np.abs(direction), 0.2)
    across = 1 - np.abs(direction)
    np.testing.assert_allclose(np.ptp(modules[0], axis=0) @ across, 2 * 0.027)
    corners = np.concatenate([base, *modules])
    box = side.viewLim
    assert (corners >= box.min).all()
    assert (corners <= box.max).all()
    origin, right, up = side.transData.transform([(0, 0), (0.1, 0), (0, 0.1)])
    np.testing.assert_allclose(right[0] - origin[0], up[1] - origin[1])


def test_the_rows_of_the_table_have_the_order_of_the_side_view(make_arm, side_of):
    for up, numbers in ((1, ["3", "2", "1"]), (-1, ["1", "2", "3"])):
        side = side_of(make_arm(gravity_direction=(0, 0, -up)))
        (table,) = side.figure.axes[3].tables
        cells = table.get_celld()
        assert [cells[row, 0].get_text().get_text() for row in (1, 2, 3)] == numbers


def test_boundaries_are_numbered_in_millimeters_from_the_base(make_arm, side_of):
    side = side_of(make_arm(gravity_direction=(0, 0, 1)))
    ticks = zip(side.get_yticks(), side.get_yticklabels(), strict=True)
    labels = {round(-1000 * tick): label.get_text() for tick, label in ticks}
    assert labels == {0: "0", 200: "200", 400: "400", 600: "600"}
    assert len(side_of(make_arm(20)).get_yticks()) <= 10
