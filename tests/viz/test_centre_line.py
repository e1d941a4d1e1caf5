import numpy as np

from s2c2a.viz import centre_line

LENGTHS = np.full(3, 0.2)


def test_the_centre_line_starts_at_the_base_and_passes_through_every_module_end(make_trace):
    states = make_trace().states
    line = centre_line(states, LENGTHS, points_per_module=10)
    assert line.shape == (200, 31, 3)
    np.testing.assert_allclose(line[:, 0], 0.0)
    np.testing.assert_allclose(line[:, 10::10], states[..., :3], atol=1e-12)


def test_the_centre_line_leaves_each_end_along_its_axis(make_trace):
    states = make_trace().states[0]
    line = centre_line(states, LENGTHS, points_per_module=2000)
    steps = np.diff(line, axis=0)
    before = steps[1999::2000] / np.linalg.norm(steps[1999::2000], axis=-1, keepdims=True)
    np.testing.assert_allclose(before, states[:, 3:], atol=1e-3)
    np.testing.assert_allclose(steps[0] / np.linalg.norm(steps[0]), [0, 0, 1], atol=1e-3)


def test_a_straight_arm_has_a_straight_and_even_centre_line():
    states = np.array([[0, 0, z, 0, 0, 1] for z in (0.2, 0.4, 0.6)], dtype=float)
    line = centre_line(states, LENGTHS, points_per_module=4)
    np.testing.assert_allclose(line[:, 2], np.linspace(0, 0.6, 13), atol=1e-12)
    np.testing.assert_allclose(line[:, :2], 0.0)


def test_a_quarter_circle_is_drawn_within_a_hundredth_of_its_length():
    radius = 0.2 / (np.pi / 2)
    line = centre_line(np.array([[radius, 0, radius, 1, 0, 0]]), np.array([0.2]), points_per_module=50)
    distance = np.linalg.norm(line - [radius, 0, 0], axis=-1)
    assert np.abs(distance - radius).max() < 0.011 * 0.2
