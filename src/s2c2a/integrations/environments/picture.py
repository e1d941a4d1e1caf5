"""Pictures of an arm, its goal and an obstacle, for `rgb_array`."""

import numpy as np
from jaxtyping import Float, UInt8
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d import Axes3D

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.arm.geometry import center_line
from s2c2a.spaces import AXIS, States
from s2c2a.viz.colors import DESIRED, OBSTACLE, REAL

SIZE = 4.0  # inches
DOTS = 80  # per inch
CIRCLE = np.linspace(0.0, 2 * np.pi, 24)


def draw(
    arm: ArmSpec,
    states: States,
    goal: Float[np.ndarray, "3"],
    obstacle: Float[np.ndarray, "4"] | None,
) -> UInt8[np.ndarray, "height width 3"]:
    """Draw the center line, the goal of the tip, and a sphere.

    Args:
        arm: the arm.
        states: of its module ends [m, 1], base frame.
        goal: of the tip [m], base frame.
        obstacle: center and radius [m], base frame; None for none.
    """
    figure = Figure((SIZE, SIZE), dpi=DOTS)
    canvas = FigureCanvasAgg(figure)
    axes = Axes3D(figure, rect=(0.0, 0.0, 1.0, 1.0))
    figure.add_axes(axes)
    lengths = ArmGeometry.of(arm).lengths
    points = np.vstack([np.zeros(3), center_line(states, lengths)])
    axes.plot(*points.T, color=REAL, linewidth=5)
    direction = states[-1, AXIS]
    axes.quiver(*points[-1], *direction, length=0.1 * arm.length, color=REAL)
    axes.plot(*goal[:, None], color=DESIRED, marker="o", markersize=8)
    if obstacle is not None:
        sines = np.sin(CIRCLE)
        cosines = np.cos(CIRCLE)
        ball = np.stack(
            [
                np.outer(cosines, sines),
                np.outer(sines, sines),
                np.outer(np.ones_like(sines), cosines),
            ]
        )
        surface = obstacle[:3, None, None] + obstacle[3] * ball
        axes.plot_surface(*surface, color=OBSTACLE)
    reach = arm.length
    axes.set(
        xlim=(-reach, reach),
        ylim=(-reach, reach),
        zlim=(-0.5 * reach, reach),
    )
    axes.set_box_aspect((2.0, 2.0, 1.5))
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()
