"""What is round an arm, in viser: light, the plane it is mounted on, the base frame, and where things fall."""

from typing import Any

import numpy as np
from jaxtyping import Float
from viser import SceneApi

from s2c2a.arm import ArmSpec
from s2c2a.viz.colours import GRID, GRID_STRONG, INK, rgb
from s2c2a.viz.mesh import threads, tube_faces
from s2c2a.viz.mounting import Surroundings

LINE = 0.0012  # half the width of a grid's line in parts of the arm's length
SUN = (1.0, -1.4, 2.0)
NO_SHADOW: dict[str, Any] = {"cast_shadow": False, "receive_shadow": False}


def lay_ground(scene: SceneApi, arm: ArmSpec) -> Surroundings:
    """Turn the scene upright, light it, and put in what never moves; everything stays in the base frame."""
    around = Surroundings.of(arm)
    scene.set_up_direction(around.mounting.turn[2])
    _light(scene, tuple(SUN @ around.mounting.turn))
    _floor(scene, around.grid, LINE * arm.length)
    scene.add_frame("/base_frame", axes_length=0.2 * arm.length, axes_radius=0.005 * arm.length)
    for name, place in around.names.items():
        scene.add_label(f"/base_frame/{name}", name, position=place, font_screen_scale=0.8)
    if around.arrow is not None:
        _gravity(scene, around.arrow, arm.length)
    return around


def _light(scene: SceneApi, sun: tuple[float, float, float]) -> None:
    scene.configure_environment_map(None)
    scene.configure_default_lights(enabled=False)
    sky: dict[str, Any] = {"sky_color": (255, 255, 255), "ground_color": (190, 198, 210), "intensity": 1.6}
    scene.add_light_hemisphere("/lights/sky", **sky)
    scene.add_light_directional("/lights/sun", color=(255, 250, 240), intensity=2.0, cast_shadow=False, position=sun)
    scene.world_axes.visible = False


def _floor(scene: SceneApi, grid: Float[np.ndarray, "lines 2 3"], half: float) -> None:
    """Lines of two triangles: a shader's grid costs a browser without a graphics card a sixth of its time."""
    in_middle = np.abs(grid.sum(axis=1)[:, :2]).max(axis=-1) < half
    for name, lines, colour in (("fine", grid[~in_middle], GRID), ("strong", grid[in_middle], GRID_STRONG)):
        aside = half * np.cross((0.0, 0.0, 1.0), np.sign(lines[:, 1] - lines[:, 0]))[:, None]
        corners = np.stack([lines - aside, lines + aside], axis=2).reshape(-1, 3).astype(np.float32)
        faces = np.array([(0, 2, 1), (1, 2, 3)]) + 4 * np.arange(len(lines))[:, None, None]
        flat: dict[str, Any] = {"flat_shading": True, "side": "double", **NO_SHADOW}
        scene.add_mesh_simple(f"/floor/{name}", corners, faces.reshape(-1, 3), color=rgb(colour), **flat)


def _gravity(scene: SceneApi, arrow: Float[np.ndarray, "2 3"], size: float) -> None:
    """Where things fall, of an arm that does not stand."""
    line = np.linspace(arrow[0], arrow[1], 12)
    corners = threads(line[None], 0.006 * size).astype(np.float32)
    scene.add_mesh_simple("/gravity/line", corners, tube_faces(1, len(line), 3), color=rgb(INK), **NO_SHADOW)
    scene.add_icosphere("/gravity/end", 0.018 * size, color=rgb(INK), position=arrow[1], **NO_SHADOW)
    scene.add_label("/gravity/word", "gravity", position=arrow[0], font_screen_scale=0.8)
