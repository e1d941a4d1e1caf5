"""The arm's surface."""

import numpy as np
import pytest

from s2c2a.arm.geometry import center_line
from s2c2a.viz.mesh import BODY_ROWS, ArmMesh, frames_of


def volume(corners, faces) -> float:
    a, b, c = np.swapaxes(corners[faces], 0, 1)
    return float(np.einsum("fk,fk->", a, np.cross(b, c)) / 6)


def named(mesh, vertices, name):
    return [
        (corners, piece.faces)
        for piece, corners in zip(mesh.pieces, vertices, strict=True)
        if piece.name == name
    ]


def test_every_piece_faces_outwards(make_trace, arm):
    mesh = ArmMesh(arm)
    vertices = mesh.vertices(make_trace().states[0])
    names = {piece.name for piece in mesh.pieces}
    assert names == {"module", "cables", "discs", "tip", "base"}
    for piece, corners in zip(mesh.pieces, vertices, strict=True):
        assert volume(corners, piece.faces) > 0
        assert piece.faces.max() == len(corners) - 1


def test_a_straight_module_is_a_cylinder_around_its_cables(straight, arm):
    mesh = ArmMesh(arm)
    ((corners, _), *_) = named(mesh, mesh.vertices(straight), "module")
    np.testing.assert_allclose(np.linalg.norm(corners[:, :2], axis=-1), 1.12 * 0.027)
    assert (corners[:, 2].min(), corners[:, 2].max()) == pytest.approx((0.0, 0.2))


def test_a_module_has_the_radius_that_the_arm_file_states(straight, arm):
    first, *others = arm.modules
    thick = first.model_copy(update={"radius": 0.05})
    mesh = ArmMesh(arm.model_copy(update={"modules": (thick, *others)}))
    (corners, _), (other, _), _ = named(mesh, mesh.vertices(straight), "module")
    np.testing.assert_allclose(np.linalg.norm(corners[:, :2], axis=-1), 0.05)
    np.testing.assert_allclose(np.linalg.norm(other[:, :2], axis=-1), 1.12 * 0.027)


@pytest.mark.parametrize("bend", [0.01, 0.26, 1.4])
def test_the_tubes_follow_the_center_line_with_constant_radius(make_trace, arm, bend):
    mesh, states = ArmMesh(arm), make_trace(bend=bend).states[30]
    rings = np.reshape(mesh.vertices(states)[:3], (3, BODY_ROWS, -1, 3))
    middles = rings.mean(axis=2)
    line = center_line(states, np.full(3, 0.2), BODY_ROWS - 1)
    np.testing.assert_allclose(middles[:, 1:].reshape(-1, 3), line, atol=1e-12)
    widths = np.linalg.norm(rings - middles[:, :, None], axis=-1)
    np.testing.assert_allclose(widths, 1.12 * 0.027)


def test_frames_are_rotations_without_twist_that_point_along_the_axes(make_trace):
    states = make_trace(bend=0.5).states
    frames = frames_of(states)
    np.testing.assert_array_equal(frames[:, 0, 1:], [np.eye(3)] * 200)
    np.testing.assert_allclose(frames[:, 1:, 0], states[..., :3])
    np.testing.assert_allclose(frames[:, 1:, 3], states[..., 3:], atol=1e-12)
    turns = frames[..., 1:, :]
    products = turns @ np.swapaxes(turns, -1, -2)
    unit = np.broadcast_to(np.eye(3), turns.shape)
    np.testing.assert_allclose(products, unit, atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(turns), 1.0)
    # from each frame to the next
    steps = np.einsum("tmki,tmkj->tmij", turns[:, 1:], turns[:, :-1])
    axes = np.cross(states[:, 0, 3:], states[:, 1, 3:])
    turned = np.einsum("tij,tj->ti", steps[:, 1], axes)
    np.testing.assert_allclose(turned, axes, atol=1e-12)


def test_cables_lie_on_the_module_at_their_angles(make_arm, straight):
    mesh = ArmMesh(make_arm(3, 4))
    ((corners, _), *_) = named(mesh, mesh.vertices(straight), "cables")
    eyes = corners.reshape(4, BODY_ROWS, 3, 3)[:, 0].mean(axis=1)
    angles = np.rad2deg(np.arctan2(eyes[:, 1], eyes[:, 0])) % 360
    np.testing.assert_allclose(angles, [0, 90, 180, 270], atol=1e-9)


def test_the_outline_keeps_the_volume_of_the_modules(make_trace, make_arm):
    for modules in (1, 3, 20):
        mesh = ArmMesh(make_arm(modules))
        vertices = mesh.vertices(make_trace(modules=modules, bend=0.05).states[0])
        outline = mesh.outline(vertices)
        assert mesh.outline_faces.max() == len(outline) - 1
        body = sum(volume(*tube) for tube in named(mesh, vertices, "module"))
        assert volume(outline, mesh.outline_faces) == pytest.approx(body, rel=0.06)
