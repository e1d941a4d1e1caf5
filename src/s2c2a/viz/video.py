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
from s2c2a.viz.body import Body
from s2c2a.viz.colours import FAINT, INK, MUTED, TARGET, module_colours
from s2c2a.viz.trace import Trace, check_same_arm

SIZE, FINER = (480, 400), 2  # pixels, and how much finer it is painted
MOST_FRAMES, COLOURS = 120, 64
EYE, TOWARDS = np.array([1.9, -2.0, 1.25]), np.array([0.0, 0.0, 0.48])  # in parts of the arm's length
SCALE = 1.6  # heights of the picture that one arm's length fills at its distance
LIGHT = np.array([0.35, -0.55, 0.76])
BACKGROUND, DISC, REAL, OBSTACLE = "#ffffff", "#c4cbd5", "#1f5fc4", "#8a93a6"


def save_video(trace: Trace, arm: ArmSpec, path: Path, ending: str | None = None) -> Path:
    """Write a run as a moving picture.

    Args:
        trace: the run.
        arm: the arm that ran it.
        path: of the file; its ending is put right.
        ending: "mp4" or "gif"; unless stated what this machine can do.

    Raises:
        S2C2AError: the trace is of another arm, ffmpeg fails, or the file cannot be written.
    """
    check_same_arm([trace], arm)
    ending = ending or ("mp4" if shutil.which("ffmpeg") else "gif")
    steps = np.arange(0, trace.times.size, max(1, -(-trace.times.size // MOST_FRAMES)))
    seconds = float(trace.times[-1] - trace.times[0]) / max(len(steps) - 1, 1) or 0.1
    frames = _frames(trace, arm, steps)
    write = _write_mp4 if ending == "mp4" else _write_gif
    return write(frames, path.with_suffix(f".{ending}"), seconds)


def _frames(trace: Trace, arm: ArmSpec, steps: np.ndarray) -> Iterator[Image.Image]:
    body, camera = Body(arm), _Camera(arm.length)
    for step in steps:
        canvas = Image.new("RGB", (FINER * SIZE[0], FINER * SIZE[1]), BACKGROUND)
        painter = ImageDraw.Draw(canvas)
        _paint_floor(painter, camera, arm.length)
        _paint_path(painter, camera, trace.wanted_path, TARGET)
        _paint_path(painter, camera, trace.followed_path[: step + 1], REAL)
        _paint_obstacles(painter, camera, trace.obstacles[step])
        _paint_arm(painter, camera, body, np.nan_to_num(trace.states[step]), arm)
        _paint_target(painter, camera, trace.wanted_path[step])
        painter.text((16, 12), f"{trace.label}   {trace.times[step] - trace.times[0]:.1f} s", MUTED, font_size=26)
        yield canvas.resize(SIZE, Image.Resampling.LANCZOS)


class _Camera:
    """Where points of the base frame are on the canvas."""

    def __init__(self, size: float):
        self._eye = size * EYE
        ahead = TOWARDS - EYE
        self._distance = size * float(np.linalg.norm(ahead))
        self.ahead = ahead / np.linalg.norm(ahead)
        self._right = np.cross(self.ahead, (0, 0, 1)) / np.linalg.norm(np.cross(self.ahead, (0, 0, 1)))
        self._up = np.cross(self._right, self.ahead)
        self._scale = FINER * SIZE[1] / SCALE / size * self._distance

    def places(self, points: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
        """Columns, rows [pixels], and depths [m]."""
        seen = points - self._eye
        depth = seen @ self.ahead
        across, high = self._scale * (seen @ self._right) / depth, self._scale * (seen @ self._up) / depth
        return np.stack([FINER * SIZE[0] / 2 + across, FINER * SIZE[1] / 2 - high, depth], axis=-1)

    def pixels(self, length: float, depth: float) -> float:
        """How long a length [m] is at a depth."""
        return self._scale * length / depth


def _paint_arm(painter, camera: _Camera, body: Body, states, arm: ArmSpec) -> None:
    shape = body.shape(states)
    parts = [
        (tube, body.tube_faces, colour)
        for tube, colour in zip(shape.modules, module_colours(arm.module_count), strict=True)
    ]
    faces, colours = [], []
    for vertices, corners, colour in [*parts, (shape.discs, body.disc_faces, DISC)]:
        triangles = vertices[corners]
        faces.append(triangles)
        colours.append(_lit(triangles, colour))
    triangles, shades = np.concatenate(faces), np.concatenate(colours)
    places = camera.places(triangles)
    for number in np.argsort(-places[..., 2].mean(axis=1)):
        painter.polygon([tuple(corner) for corner in places[number, :, :2]], tuple(shades[number]))


def _lit(triangles: Float[np.ndarray, "faces 3 3"], colour: str) -> np.ndarray:
    """Colours of faces in soft light from above."""
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-12)
    bright = 0.68 + 0.36 * np.clip(normals @ LIGHT, 0.0, 1.0)
    base = np.array([int(colour[place : place + 2], 16) for place in (1, 3, 5)])
    return np.clip(bright[:, None] * base, 0, 255).astype(int)


def _paint_floor(painter, camera: _Camera, size: float) -> None:
    reach = 0.8 * size
    for place in np.linspace(-reach, reach, 9):
        for ends in (((place, -reach, 0), (place, reach, 0)), ((-reach, place, 0), (reach, place, 0))):
            painter.line([tuple(end[:2]) for end in camera.places(np.array(ends, float))], FAINT, FINER)


def _paint_path(painter, camera: _Camera, points, colour: str) -> None:
    known = points[np.isfinite(points).all(axis=-1)]
    if len(known) > 1:
        painter.line([tuple(place[:2]) for place in camera.places(known)], colour, 2 * FINER, joint="curve")


def _paint_obstacles(painter, camera: _Camera, obstacles) -> None:
    for *centre, radius in obstacles:
        if radius > 0 and np.isfinite(centre).all():
            _paint_ball(painter, camera, np.array(centre), radius, outline=OBSTACLE, fill="#dde1e8")


def _paint_target(painter, camera: _Camera, point) -> None:
    if np.isfinite(point).all():
        column, row, _ = camera.places(point)
        for radius, colour in ((8, BACKGROUND), (6, TARGET)):
            painter.ellipse(_square(column, row, FINER * radius), fill=colour, outline=INK)


def _paint_ball(painter, camera: _Camera, centre, radius: float, outline: str, fill: str) -> None:
    column, row, depth = camera.places(centre)
    painter.ellipse(_square(column, row, camera.pixels(radius, depth)), fill=fill, outline=outline, width=FINER)


def _square(column: float, row: float, half: float) -> tuple[float, float, float, float]:
    return column - half, row - half, column + half, row + half


def _write_gif(frames: Iterator[Image.Image], path: Path, seconds: float) -> Path:
    pictures = [frame.quantize(COLOURS, dither=Image.Dither.NONE) for frame in frames]
    content = BytesIO()
    pictures[0].save(
        content, "GIF", save_all=True, append_images=pictures[1:], duration=round(1000 * seconds), loop=0, optimize=True
    )
    return save_whole(content.getvalue(), path)


def _write_mp4(frames: Iterator[Image.Image], path: Path, seconds: float) -> Path:
    with TemporaryDirectory() as folder:
        for number, frame in enumerate(frames):
            frame.save(Path(folder) / f"{number:05d}.png")
        film = Path(folder) / "film.mp4"
        command = ["ffmpeg", "-loglevel", "error", "-framerate", f"{1 / seconds:.3f}", "-i", f"{folder}/%05d.png"]
        done = subprocess.run([*command, "-pix_fmt", "yuv420p", str(film)], capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise S2C2AError(f"ffmpeg could not write the film: {done.stderr.strip()}; take it off the path for a GIF")
        return save_whole(film.read_bytes(), path)
