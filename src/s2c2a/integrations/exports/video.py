"""Videos of runs, GIF or MP4.

Matplotlib paints the frames, without a window, a graphics card or OpenGL.
"""

import itertools
from collections.abc import Callable
from pathlib import Path
from subprocess import CalledProcessError
from tempfile import TemporaryDirectory

import numpy as np
from matplotlib.animation import AbstractMovieWriter, FFMpegWriter, PillowWriter
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d import Axes3D
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection

from s2c2a.arm import ArmSpec
from s2c2a.episodes import load_episodes
from s2c2a.errors import S2C2AError
from s2c2a.files.text import write_atomically
from s2c2a.obstacles import is_sphere
from s2c2a.viz.arrays import Points
from s2c2a.viz.colors import DESIRED, GRID, INK, MUTED, OBSTACLE, REAL
from s2c2a.viz.mesh import THREAD_SIDES, ArmMesh, threads, tube_faces, unit
from s2c2a.viz.mounting import EYE, LOOK_AT, SUN, Surroundings
from s2c2a.viz.solids import hull, surface
from s2c2a.viz.trace import Trace

SIZE = (480, 400)  # pixels
MAX_FRAMES = 120  # so that a GIF remains small enough for a page

VIEW_SIZE = 1.2  # edge of the cube that fills the frame, arm lengths
AXIS_LENGTH = 0.15  # of the line along the desired axis, arm lengths
THREAD_RADIUS = 0.006  # of drawn paths, arm lengths; a look
BEHIND, SOLID, FRONT = 1, 2, 3  # drawing order


def write_gif(file: Path, out: Path) -> str:
    """Write a video of the first episode of a file; see `save_video`."""
    return _write_video(file, out, PillowWriter)


def write_mp4(file: Path, out: Path) -> str:
    """Write a video of the first episode of a file by ffmpeg; see `save_video`."""
    return _write_video(file, out, FFMpegWriter)


def _write_video(
    file: Path, out: Path, kind: Callable[..., AbstractMovieWriter]
) -> str:
    episodes, _ = load_episodes(file)
    label = str(episodes[0].options.get("strategy", ""))
    save_video(Trace(episodes[0], label), out, kind)
    return f"1 of {len(episodes)} episodes"


def save_video(
    trace: Trace, path: Path, kind: Callable[..., AbstractMovieWriter]
) -> None:
    """Write a video of a run.

    Args:
        trace: the run.
        path: of the file.
        kind: of its writer.

    Raises:
        S2C2AError: ffmpeg is missing or fails, or the file cannot be written.
    """
    arm = trace.episode.arm
    stride = max(1, -(-trace.times.size // MAX_FRAMES))
    steps = range(0, trace.times.size, stride)
    duration = float(trace.times[-1] - trace.times[0])
    seconds = duration / max(len(steps) - 1, 1) or 0.1
    stage = VideoStage(arm)
    writer = kind(fps=1 / seconds)
    with TemporaryDirectory() as folder:
        video = Path(folder) / f"video{path.suffix}"
        try:
            with writer.saving(stage.figure, str(video), stage.figure.dpi):
                for step in steps:
                    stage.draw(trace, step)
                    writer.grab_frame()
        except (CalledProcessError, OSError) as error:
            raise S2C2AError(
                f"cannot make the video: {error}. "
                "If ffmpeg fails or is missing, write a GIF: --to gif."
            ) from error
        write_atomically(video.read_bytes(), path)


class VideoStage:
    """Figure of one arm at one step of a run, seen by a camera upright in the world.

    Attributes:
        figure: what `draw` has drawn.
    """

    def __init__(self, arm: ArmSpec, eye: tuple[float, float, float] = EYE):
        """Place the camera so that it sees the whole arm from a side, see `Mounting`."""
        self._mesh = ArmMesh(arm)
        self._length = arm.length
        self._surroundings = Surroundings.of(arm)
        placed = self._surroundings.mounting.placed
        self._center = self._world(arm.length * placed(LOOK_AT))
        self._towards_eye = unit(self._world(placed(eye) - placed(LOOK_AT)))
        self.figure = Figure(figsize=(SIZE[0] / 100, SIZE[1] / 100), dpi=100)
        FigureCanvasAgg(self.figure)
        square = (0, -0.1, 1, 1.2)
        self._axes = Axes3D(self.figure, square, computed_zorder=False)
        self.figure.add_axes(self._axes)
        self._axes.set_box_aspect((1, 1, 1))
        x, y, z = self._towards_eye
        elevation = np.arcsin(z)
        azimuth = np.arctan2(y, x)
        self._axes.view_init(np.rad2deg(elevation), np.rad2deg(azimuth))
        self._axes.set_proj_type("persp", focal_length=1.6)

    def _world(self, points: Points) -> Points:
        """Points of the base frame along the world's axes."""
        return points @ self._surroundings.mounting.turn.T

    def draw(self, trace: Trace, step: int) -> None:
        """Draw the run at one step, the target in front of the arm."""
        axes = self._axes
        axes.clear()
        axes.set_axis_off()
        half = VIEW_SIZE / 2 * self._length
        x, y, z = self._center[:, None] + (-half, half)
        axes.set(xlim=x, ylim=y, zlim=z)
        self._draw_ground()
        # draw obstacles other than balls as translucent faces behind the arm
        obstacles = trace.standing(step)
        for row in itertools.filterfalse(is_sphere, obstacles):
            corners, triangles = hull(surface(row, self._length))
            faces = self._world(corners)[triangles]
            veil = Poly3DCollection(faces, facecolors=OBSTACLE + "38", zorder=BEHIND)
            self._axes.add_collection3d(veil)
        self._draw_solids(trace, step)
        self._draw_line(trace.horizon[step], MUTED, zorder=FRONT)
        position = trace.desired_path[step]
        axis = trace.desired_axes[step, trace.pointing_module]
        tip = position + AXIS_LENGTH * self._length * axis
        self._draw_line(np.stack([position, tip]), DESIRED, zorder=FRONT)
        dot = {"marker": "o", "markersize": 9, "markeredgecolor": "white"}
        self._draw_line(position[None], DESIRED, zorder=FRONT, **dot)
        time = trace.times[step] - trace.times[0]
        text = f"{trace.label}   {time:.1f} s"
        style = {"color": MUTED, "parse_math": False}
        axes.text2D(0.02, 0.03, text, transform=self.figure.transFigure, **style)

    def _draw_ground(self) -> None:
        """Draw the grid, the names of its axes, and gravity."""
        lines = self._world(self._surroundings.grid)
        self._axes.add_collection3d(
            Line3DCollection(lines, colors=GRID, linewidths=0.8, zorder=BEHIND)
        )
        for name, position in self._surroundings.names.items():
            self._write(position, name)
        arrow = self._surroundings.arrow
        if arrow is not None:
            self._draw_line(arrow, INK, linewidth=2.5)
            self._draw_line(arrow[1:], INK, marker="o")
            gap = 0.06 * self._length * self._surroundings.mounting.gravity
            self._write(arrow[0] - gap, "gravity")

    def _draw_solids(self, trace: Trace, step: int) -> None:
        """Draw the faces of arm, obstacles and paths, the farthest first."""
        balls = filter(is_sphere, trace.standing(step))
        solids = [(ball[:3] + ball[3] * _BALL, OBSTACLE, 0.0) for ball in balls]
        solids.append((self._thread(trace.desired_path), DESIRED, 0.0))
        solids.append((self._thread(trace.followed_path[: step + 1]), REAL, 0.0))
        if np.isfinite(trace.states[step]).all():
            vertices = self._mesh.vertices(trace.states[step])
            for piece, corners in zip(self._mesh.pieces, vertices, strict=True):
                solids.append((corners[piece.faces], piece.color, piece.lift))
        placed = [self._world(solid[0]) for solid in solids]
        colors = [solid[1] for solid in solids]
        shades = np.concatenate([*map(_shaded, placed, colors)])
        lifts = [solid[2] * self._towards_eye for solid in solids]
        self._axes.add_collection3d(
            Poly3DCollection(
                np.concatenate([*map(np.add, placed, lifts)]),
                facecolors=shades,
                edgecolors=shades,  # no seams between the faces
                linewidths=0.3,
                zorder=SOLID,
            )
        )

    def _thread(self, path: Points) -> Points:
        """Triangles of a thin tube along a path, shape (faces, 3, 3)."""
        finite = path[np.isfinite(path).all(axis=-1)]
        if len(finite) < 2:
            return np.zeros((0, 3, 3))
        corners = threads(finite[None], THREAD_RADIUS * self._length)
        return corners[tube_faces(1, len(finite), THREAD_SIDES)]

    def _draw_line(self, points: Points, color: str, zorder=BEHIND, **style) -> None:
        finite = points[np.isfinite(points).all(axis=-1)]
        places = self._world(finite).T
        self._axes.plot(*places, color=color, zorder=zorder, **style)

    def _write(self, position, text: str) -> None:
        place = self._world(position)
        self._axes.text(*place, text, color=MUTED, ha="center", va="center")


def _shaded(triangles: Points, color: str) -> np.ndarray:
    """Colors of faces in soft light from above, 0 to 1, shape (faces, 3)."""
    edges = np.diff(triangles, axis=1)
    normals = unit(np.cross(edges[:, 0], edges[:, 1]))
    lit = np.clip(normals @ unit(np.array(SUN)), 0.0, 1.0)
    brightness = 0.68 + 0.36 * lit
    return np.clip(brightness[:, None] * to_rgb(color), 0.0, 1.0)


def _ball() -> Points:
    """Triangles of a ball of radius one, shape (faces, 3, 3)."""
    polar = np.linspace(0.0, np.pi, 19)[:, None]
    around = np.linspace(0.0, 2.0 * np.pi, 36, endpoint=False)
    x = np.sin(polar) * np.cos(around)
    y = np.sin(polar) * np.sin(around)
    height = -np.cos(polar)
    corners = np.stack(np.broadcast_arrays(x, y, height), axis=-1)
    return corners.reshape(-1, 3)[tube_faces(1, *x.shape)]


_BALL = _ball()
