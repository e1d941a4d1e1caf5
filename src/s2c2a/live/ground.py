"""What an arm stands on: light, floor, base, and where things fall."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float
from viser import SceneApi

from s2c2a.arm import ArmSpec
from s2c2a.viz.body import thread_faces, threads
from s2c2a.viz.colours import INK

LEVEL = -0.02  # of the floor, in parts of the arm's length
GRID, GRID_STRONG, BASE = "#d3dae3", "#b9c3cf", "#7a8594"


def rgb(colour: str) -> tuple[int, int, int]:
    """A colour as three numbers of 0 to 255."""
    red, green, blue = (int(colour[place : place + 2], 16) for place in (1, 3, 5))
    return red, green, blue


def lay_ground(scene: SceneApi, arm: ArmSpec) -> None:
    """Light the scene, and put in what never moves."""
    _light(scene)
    _floor(scene, arm.length)
    _gravity(scene, arm.length, np.array(arm.gravity_direction))


def _light(scene: SceneApi) -> None:
    scene.configure_environment_map(None)
    scene.configure_default_lights(enabled=False)
    scene.add_light_hemisphere("/lights/sky", sky_color=(255, 255, 255), ground_color=(190, 198, 210), intensity=1.6)
    scene.add_light_directional(
        "/lights/sun", color=(255, 250, 240), intensity=2.0, cast_shadow=False, position=(1, -1.4, 2)
    )
    scene.world_axes.visible = False


def _floor(scene: SceneApi, size: float) -> None:
    """A grid as wide as the arm reaches, the frame of the base, and the base itself.

    Of few triangles: a shader's grid costs a browser without a graphics card a sixth of its time.
    """
    cell = 0.1 if size > 0.3 else 0.02
    half, level = int(np.ceil(1.3 * size / cell)), LEVEL * size
    flat: dict[str, Any] = {"flat_shading": True, "cast_shadow": False, "receive_shadow": False}
    steps = np.arange(-half, half + 1)
    for name, chosen, colour in (("fine", steps % 5 != 0, GRID), ("strong", steps % 5 == 0, GRID_STRONG)):
        vertices, faces = _strips(cell * steps[chosen], 0.002 * size, half * cell, level)
        across = vertices[:, [1, 0, 2]]
        both = np.concatenate([vertices, across]), np.concatenate([faces, faces[:, ::-1] + len(vertices)])
        scene.add_mesh_simple(f"/floor/{name}", *both, color=rgb(colour), **flat)
    scene.add_cylinder("/base", radius=0.09 * size, height=0.03 * size, color=rgb(BASE), position=(0, 0, -0.015 * size))
    scene.add_frame("/base_frame", axes_length=0.2 * size, axes_radius=0.005 * size)
    for name, direction in (("x", (1, 0)), ("y", (0, 1))):
        scene.add_label(
            f"/base_frame/{name}", name, position=(*(0.22 * size * np.array(direction)), 0.0), font_screen_scale=0.8
        )


def _strips(places: Sequence[float] | np.ndarray, half_width: float, half: float, level: float):
    """Flat strips along y at places on x: vertices and faces."""
    corners = np.array([(-half_width, -half), (half_width, -half), (half_width, half), (-half_width, half)])
    vertices = np.array([[x + place, y, level] for place in places for x, y in corners], dtype=np.float32)
    faces = np.concatenate([np.array([(0, 1, 2), (0, 2, 3)]) + 4 * number for number in range(len(places))])
    return vertices, faces


def _gravity(scene: SceneApi, size: float, direction: Float[np.ndarray, "3"]) -> None:
    """Where things fall, of an arm that does not stand upright: the floor is drawn at its base all the same."""
    if not direction.any() or direction @ (0, 0, -1) > 0.999:
        return
    start = size * np.array([0.5, 0.5, 0.25])
    ends = np.linspace(start, start + 0.3 * size * direction, 12)
    scene.add_mesh_simple(
        "/gravity/line",
        threads(ends[None], 0.006 * size).astype(np.float32),
        thread_faces(1, len(ends)),
        color=rgb(INK),
        cast_shadow=False,
        receive_shadow=False,
    )
    scene.add_icosphere("/gravity/end", 0.018 * size, color=rgb(INK), position=ends[-1], cast_shadow=False)
    scene.add_label("/gravity/word", "gravity", position=ends[0], font_screen_scale=0.8)
