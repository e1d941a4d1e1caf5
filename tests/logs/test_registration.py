"""First estimate of the base frame from known motions of the ends."""

import numpy as np
import pytest

from s2c2a.logs import map_from_toml
from s2c2a.logs.errors import LogError
from s2c2a.logs.registration import estimate_registration

MAP = """
[rows]
kind = "steps"
[arm]
name = "arm"
modules = {modules}
control_rate = 10
{arm}
[[drives]]
commanded = "m"
unit = "mm"
{ends}
[frame]
{frame}
"""
END = '[[ends]]\nmodule = {}\nposition = ["x{}", "y{}", "z{}"]\nunit = "m"\n'


def make_map(ends, modules, arm="", frame=""):
    text = "".join(END.format(*[module] * 4) for module in ends)
    return map_from_toml(MAP.format(modules=modules, arm=arm, ends=text, frame=frame))


def straight(heights, rows=40):
    """Straight arm along z, with the base at the origin."""
    positions = np.zeros((rows, len(heights), 3))
    positions[..., 2] = heights
    return positions


def test_a_stated_frame_and_stated_lengths_are_kept():
    log_map = make_map(
        [1],
        2,
        arm="lengths = [0.1, 0.2]",
        frame='along = "-y"\nx = "z"\nbase = [1.0, 2.0, 3.0]',
    )
    registration = estimate_registration(straight([0.3]), log_map)
    np.testing.assert_allclose(registration.axes[:, 2], [0, -1, 0])
    np.testing.assert_allclose(registration.axes[:, 0], [0, 0, 1])
    np.testing.assert_allclose(registration.base, [1, 2, 3])
    np.testing.assert_allclose(registration.lengths, [0.1, 0.2])


def test_lengths_follow_from_the_heights_of_the_ends_above_the_base():
    log_map = make_map([0, 2], 3, frame='along = "z"\nbase = [0.0, 0.0, 0.0]')
    registration = estimate_registration(straight([0.1, 0.5]), log_map)
    np.testing.assert_allclose(registration.lengths, [0.1, 0.2, 0.2])


def test_the_base_is_one_arm_length_below_the_tip():
    log_map = make_map([1], 2, arm="length = 0.3", frame='along = "z"')
    positions = straight([1.3])
    registration = estimate_registration(positions, log_map)
    np.testing.assert_allclose(registration.base, [0, 0, 1.0], atol=1e-12)


def test_the_axes_are_a_right_handed_frame():
    log_map = make_map([0], 1, "length = 0.3", "along = [1.0, 2.0, 3.0]")
    axes = estimate_registration(straight([0.3]), log_map).axes
    np.testing.assert_allclose(axes.T @ axes, np.eye(3), atol=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1.0)


def test_a_tip_that_is_hardly_measured_is_refused():
    positions = straight([0.3])
    positions[5:] = np.nan
    with pytest.raises(LogError, match="measured in 5 rows; at least 10"):
        estimate_registration(positions, make_map([0], 1, frame='along = "z"'))
