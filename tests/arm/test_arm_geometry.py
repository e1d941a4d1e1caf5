import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import s2c2a
from cable_layouts import arm_of, layouts
from s2c2a.arm import ArmGeometry
from s2c2a.arm.geometry import balanced_pull, cable_matrix, interpolated
from s2c2a.arm.spec import largest_gap_deg


def geometry_of(angles, actuation="displacement", furthest=15.0):
    """One module of 45 deg full bend and 20 N pretension."""
    values = {"bend_limit_deg": 45.0, "pretension": 20.0, "tension_range": furthest}
    return ArmGeometry.of(arm_of(angles, actuation, **values))


@pytest.mark.parametrize(
    ("angles", "gap"),
    [
        ((0, 120, 240), 120),
        ((0, 90, 180, 270), 90),
        ((350, 10, 100), 250),
        ((-30, 30, 750), 300),
        ((720, 0, 0), 360),
    ],
)
def test_the_largest_gap_can_cross_zero_degrees(angles, gap):
    assert largest_gap_deg(angles) == pytest.approx(gap)


def test_a_cable_shortens_when_the_module_bends_towards_it():
    matrix = cable_matrix(np.deg2rad([0.0, 90.0, 180.0, 270.0]))
    np.testing.assert_allclose(matrix, [[-1, 0], [0, -1], [1, 0], [0, 1]], atol=1e-12)


@settings(deadline=None)
@given(layouts(0.1, 178.9))
@example((0.0, 60.0, 100.0, 260.0, 300.0))
def test_neutral_tensions_of_any_layout_do_not_bend_and_no_cable_pushes(angles):
    geometry = geometry_of(angles, "tension")
    moments = geometry.cable_matrices[0].T @ geometry.action_neutral[0]
    np.testing.assert_allclose(moments, 0.0, atol=1e-9)
    assert geometry.action_neutral.min() > 0


def test_three_cables_at_rest_follow_the_law_of_sines():
    """Balanced tensions are proportional to the sines of the opposite angles."""
    pulls = balanced_pull(cable_matrix(np.deg2rad([0.0, 90.0, 225.0])))
    sines = np.sin(np.deg2rad([135.0, 135.0, 90.0]))
    np.testing.assert_allclose(pulls / pulls[0], sines / sines[0], rtol=1e-12)


def test_a_displacement_arm_rests_at_zero_and_moves_by_radius_times_full_bend():
    geometry = geometry_of((0, 120, 240))
    reach = 0.027 * np.pi / 4
    np.testing.assert_array_equal(geometry.action_neutral, np.zeros((1, 3)))
    np.testing.assert_allclose(geometry.action_scale, [reach])
    np.testing.assert_allclose(geometry.action_high, np.full((1, 3), reach))
    np.testing.assert_allclose(geometry.action_low, np.full((1, 3), -reach))


def test_a_tension_arm_rests_at_its_pretension_and_moves_by_its_tension_range():
    geometry = geometry_of((0, 90, 180, 270), "tension")
    np.testing.assert_allclose(geometry.action_neutral, np.full((1, 4), 20.0))
    np.testing.assert_allclose(geometry.action_high, np.full((1, 4), 35.0))
    np.testing.assert_allclose(geometry.action_low, np.full((1, 4), 5.0))
    np.testing.assert_allclose(geometry.action_scale, [-15.0])


def test_tension_limits_are_never_negative():
    geometry = geometry_of((0, 90, 180, 270), "tension", 50.0)
    np.testing.assert_array_equal(geometry.action_low, np.zeros((1, 4)))


@settings(deadline=None)
@given(layouts(0.1, 178.9), st.floats(-np.pi, np.pi))
def test_full_bend_in_any_direction_is_within_the_limits(angles, direction):
    geometry = geometry_of(angles)
    bend = [np.cos(direction), np.sin(direction)]
    action = geometry.action_scale[0] * geometry.cable_matrices[0] @ bend
    assert (action <= geometry.action_high[0] + 1e-12).all()
    assert (action >= geometry.action_low[0] - 1e-12).all()


@settings(deadline=None)
@given(layouts(0.1, 178.9), st.sampled_from(["displacement", "tension"]))
def test_commanded_bends_are_those_of_the_actions_and_no_common_motion(
    angles, actuation
):
    geometry = geometry_of(angles, actuation)
    shares = np.array([[[0.3, -0.4]], [[0.0, 0.0]]])
    bends = geometry.commanded_bends(geometry.actions_at(shares))
    np.testing.assert_allclose(bends, shares * geometry.action_bends[0], atol=1e-9)


def test_cables_become_bends_in_one_place():
    source = Path(s2c2a.__file__).parent
    product = re.compile(r"einsum\([^()]*bend_matrices|bend_matrices(\[\w+\])? @")
    places = [
        file.relative_to(source).as_posix()
        for file in sorted(source.rglob("*.py"))
        if product.search(file.read_text(encoding="utf-8"))
    ]
    assert places == ["arm/geometry.py"]


def test_torsional_stiffness_is_bending_stiffness_unless_stated():
    module = arm_of((0, 120, 240)).modules[0]
    assert module.gj == 0.16
    assert module.model_copy(update={"torsional_stiffness": 0.05}).gj == 0.05


@pytest.mark.parametrize(
    ("sensing", "travel", "planned"),
    [
        ("encoders", 0, 1.0),
        ("encoders", 1.2, 1.2),
        ("encoders", 3, 1.5),
        ("true", 1.2, 1),
    ],
)
def test_plans_of_encoders_may_use_cable_travel_beyond_the_bend_limit(
    make_arm, sensing, travel, planned
):
    limit = np.deg2rad(50.0)
    module = {
        "bend_limit_deg": 50.0,
        "cable": {"travel": travel * limit * 0.027 or None},
    }
    geometry = ArmGeometry.of(make_arm(module=module, sensing=sensing))
    np.testing.assert_allclose(geometry.planned_bends, planned * limit)


def test_values_between_places_are_on_a_line_and_beyond_them_those_of_the_ends():
    places = np.array([0.0, 1.0, 3.0])
    values = np.array([[[0.0, 2.0]], [[1.0, 0.0]], [[5.0, 4.0]]])
    found = interpolated(np.array([-1.0, 0.5, 2.0, 9.0]), places, values)
    np.testing.assert_allclose(
        found, [[[0.0, 2.0]], [[0.5, 1.0]], [[3.0, 2.0]], [[5.0, 4.0]]]
    )
    np.testing.assert_array_equal(interpolated(2.0, places, values), found[2])
