"""A run as a moving picture: an MP4 where ffmpeg is found, a GIF otherwise. Painted face by face, without a window."""

import shutil
import subprocess
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from jaxtyping import Float
from PIL import Image, ImageDraw

from s2c2a.arm import ArmSpec
from s2c2a.errors import S2C2AError
from s2c2a.files import save_whole
from s2c2a.viz.colors import GRID, INK, MUTED, OBSTACLE, REAL, TARGET, rgb
from s2c2a.viz.mesh import ArmMesh, unit
from s2c2a.viz.mounting import Surroundings
from s2c2a.viz.trace import Trace, check_same_arm

# pixels, and how much finer it is painted
SIZE = (480, 400)
FINER = 2
MAX_FRAMES = 120
COLORS = 64
# in parts of the arm's length
EYE = (1.9, -2.0, 1.25)
TOWARDS = (0.0, 0.0, 0.48)
SCALE = 1.65  # heights of the picture that one arm's length fills at its distance
LIGHT = np.array([0.35, -0.55, 0.76])
ARROW = 0.15  # length of a desired axis in parts of the arm's length
BACKGROUND = "#ffffff"
BALL = "#dde1e8"


def save_video(
    trace: Trace, arm: ArmSpec, path: Path, ending: str | None = None
) -> Path:
    """Write a run as a moving picture.

    Args:
        trace: the run.
        arm: the arm that ran it.
        path: of the file; its ending is put right.
        ending: "mp4" or "gif"; unless stated what this machine can do.

    Raises:
        S2C2AError: the trace is of another arm, ffmpeg fails, or the file cannot be
            written.
    """
    check_same_arm([trace], arm)
    ending = ending or ("mp4" if shutil.which("ffmpeg") else "gif")
    steps = range(0, trace.times.size, max(1, -(-trace.times.size // MAX_FRAMES)))
    seconds = float(trace.times[-1] - trace.times[0]) / max(len(steps) - 1, 1) or 0.1
    studio = Studio(arm)
    write = _write_mp4 if ending == "mp4" else _write_gif
    return write(
        (studio.frame(trace, step) for step in steps),
        path.with_suffix(f".{ending}"),
        seconds,
    )


class Studio:
    """Paints pictures of one arm."""

    def __init__(self, arm: ArmSpec):
        """A camera that sees the whole arm, upright in the world."""
        self._mesh = ArmMesh(arm)
        self._round = Surroundings.of(arm)
        self._size = arm.length
        mounting = self._round.mounting
        eye, towards = (arm.length * mounting.placed(point) for point in (EYE, TOWARDS))
        self._eye = eye
        self._ahead = unit(towards - eye)
        self._right = unit(np.cross(self._ahead, mounting.turn[2]))
        self._light = LIGHT @ mounting.turn
        self._scale = (
            FINER * SIZE[1] / SCALE / arm.length * float(np.linalg.norm(towards - eye))
        )

    def frame(self, trace: Trace, step: int) -> Image.Image:
        """The arm at one step of a run."""
        canvas = Image.new("RGB", (FINER * SIZE[0], FINER * SIZE[1]), BACKGROUND)
        self._paint = ImageDraw.Draw(canvas)
        self._paint_ground()
        self._line(trace.desired_path, TARGET)
        self._line(trace.followed_path[: step + 1], REAL)
        for *center, radius in trace.spheres(step):
            self._dot(
                np.array(center),
                self._scale * radius / self.places(np.array(center))[2] / FINER,
                BALL,
                OBSTACLE,
            )
        if np.isfinite(trace.states[step]).all():
            self._paint_arm(trace.states[step])
        axis = trace.desired_axes[step, trace.pointing_module]
        end = trace.desired_path[step]
        self._line(np.stack([end, end + ARROW * self._size * axis]), TARGET)
        for size, color in ((8, BACKGROUND), (6, TARGET)):
            self._dot(end, size, color, INK)
        said = f"{trace.label}   {trace.times[step] - trace.times[0]:.1f} s"
        self._paint.text((16, FINER * SIZE[1] - 44), said, MUTED, font_size=26)
        return canvas.resize(SIZE, Image.Resampling.LANCZOS)

    def places(self, points: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
        """Columns, rows [pixels of the canvas], and depths [m] of points of the base frame."""
        seen = points - self._eye
        depth = seen @ self._ahead
        across = seen @ self._right
        high = seen @ np.cross(self._right, self._ahead)
        middle = FINER * np.array(SIZE) / 2
        scale = self._scale / depth
        return np.stack(
            [middle[0] + scale * across, middle[1] - scale * high, depth], axis=-1
        )

    def _paint_ground(self) -> None:
        for ends in self._round.grid:
            self._line(ends, GRID, FINER)
        for name, place in self._round.names.items():
            self._word(name, place)
        if self._round.arrow is not None:
            self._line(self._round.arrow, INK, 3 * FINER)
            self._dot(self._round.arrow[1], 5, INK)
            self._word(
                "gravity",
                self._round.arrow[0] - 0.06 * self._size * self._round.mounting.gravity,
            )

    def _paint_arm(self, states) -> None:
        """All faces that are turned to the eye, the farthest first."""
        corners = zip(self._mesh.pieces, self._mesh.vertices(states), strict=True)
        triangles = [(piece, vertices[piece.faces]) for piece, vertices in corners]
        lifts = np.concatenate(
            [np.full(len(faces), piece.lift) for piece, faces in triangles]
        )
        shades = np.concatenate(
            [self._lit(faces, piece.color) for piece, faces in triangles]
        )
        places = self.places(np.concatenate([faces for _, faces in triangles]))
        for number in np.argsort(lifts - places[..., 2].mean(axis=1)):
            (a, b), (c, d) = places[number, 1:, :2] - places[number, 0, :2]
            if a * d < b * c:  # rows run downward
                self._paint.polygon(
                    [tuple(corner) for corner in places[number, :, :2]],
                    tuple(shades[number]),
                )

    def _lit(self, triangles: Float[np.ndarray, "faces 3 3"], color: str) -> np.ndarray:
        """Colors of faces in soft light from above."""
        normals = unit(
            np.cross(
                triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
            )
        )
        bright = 0.68 + 0.36 * np.clip(normals @ self._light, 0.0, 1.0)
        return np.clip(bright[:, None] * rgb(color), 0, 255).astype(int)

    def _line(
        self, points: Float[np.ndarray, "points 3"], color: str, width: int = 2 * FINER
    ) -> None:
        known = points[np.isfinite(points).all(axis=-1)]
        if len(known) > 1:
            self._paint.line(
                [tuple(place[:2]) for place in self.places(known)],
                color,
                width,
                joint="curve",
            )

    def _dot(
        self,
        point: Float[np.ndarray, "3"],
        radius: float,
        fill: str,
        outline: str | None = None,
    ) -> None:
        if np.isfinite(point).all():
            column, row, _ = self.places(point)
            self._paint.circle((column, row), FINER * radius, fill, outline, FINER)

    def _word(self, text: str, point: Float[np.ndarray, "3"]) -> None:
        self._paint.text(
            tuple(self.places(point)[:2]), text, MUTED, font_size=24, anchor="mm"
        )


def _write_gif(frames: Iterator[Image.Image], path: Path, seconds: float) -> Path:
    first, *others = (
        frame.quantize(COLORS, dither=Image.Dither.NONE) for frame in frames
    )
    content = BytesIO()
    pause = round(1000 * seconds)
    first.save(
        content,
        "GIF",
        save_all=True,
        append_images=others,
        duration=pause,
        loop=0,
        optimize=True,
    )
    return save_whole(content.getvalue(), path)


def _write_mp4(frames: Iterator[Image.Image], path: Path, seconds: float) -> Path:
    with TemporaryDirectory() as folder:
        for number, frame in enumerate(frames):
            frame.save(Path(folder) / f"{number:05d}.png")
        film = Path(folder) / "film.mp4"
        command = [
            "ffmpeg",
            "-loglevel",
            "error",
            "-framerate",
            f"{1 / seconds:.3f}",
            "-i",
            f"{folder}/%05d.png",
        ]
        done = subprocess.run(
            [*command, "-pix_fmt", "yuv420p", str(film)],
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode != 0:
            raise S2C2AError(
                f"ffmpeg could not write the film: {done.stderr.strip()}; take it off the path for a GIF"
            )
        return save_whole(film.read_bytes(), path)
