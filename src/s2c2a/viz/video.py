"""Videos of runs: an MP4 where ffmpeg is installed, a GIF otherwise.

The frames are painted face by face, without a window or a graphics card.
"""

import shutil
import subprocess
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from PIL import Image, ImageDraw

from s2c2a.arm import ArmSpec
from s2c2a.errors import S2C2AError
from s2c2a.files import write_atomically
from s2c2a.spaces import States
from s2c2a.viz.arrays import Point, Points
from s2c2a.viz.camera import Camera
from s2c2a.viz.colors import DESIRED, GRID, INK, MUTED, OBSTACLE, REAL, rgb
from s2c2a.viz.mesh import ArmMesh, unit
from s2c2a.viz.mounting import Surroundings
from s2c2a.viz.trace import Trace, check_same_arm

SIZE = (480, 400)  # pixels
OVERSAMPLING = 2  # pixels painted for each pixel of the video, in both directions
MAX_FRAMES = 120
GIF_COLORS = 64

# arm lengths, see `Camera.of`
EYE = (1.9, -2.0, 1.25)
LOOK_AT = (0.0, 0.0, 0.48)
FIELD_HEIGHT = 1.65  # height of the field of view at the point looked at
AXIS_LENGTH = 0.15  # of the line along the desired axis

LIGHT = np.array([0.35, -0.55, 0.76])  # direction to the light, world axes
BACKGROUND = "#ffffff"
BALL = "#dde1e8"


def save_video(
    trace: Trace, arm: ArmSpec, path: Path, ending: str | None = None
) -> Path:
    """Write a video of a run.

    Args:
        trace: the run.
        arm: the arm that ran it.
        path: of the file; its suffix is replaced.
        ending: "mp4" or "gif"; by default "mp4" if ffmpeg is installed.

    Returns:
        Path of the written file.

    Raises:
        S2C2AError: the trace is of another arm, ffmpeg fails, or the file cannot be
            written.
    """
    check_same_arm([trace], arm)
    if ending is None:
        ending = "mp4" if shutil.which("ffmpeg") else "gif"
    stride = max(1, -(-trace.times.size // MAX_FRAMES))
    steps = range(0, trace.times.size, stride)
    duration = float(trace.times[-1] - trace.times[0])
    seconds = duration / max(len(steps) - 1, 1) or 0.1
    renderer = VideoRenderer(arm)
    frames = (renderer.frame(trace, step) for step in steps)
    write = _write_mp4 if ending == "mp4" else _write_gif
    return write(frames, path.with_suffix(f".{ending}"), seconds)


class VideoRenderer:
    """Painter of single video frames of one arm."""

    def __init__(self, arm: ArmSpec):
        """Place an upright camera that sees the whole arm."""
        self._mesh = ArmMesh(arm)
        self._surroundings = Surroundings.of(arm)
        self._length = arm.length
        mounting = self._surroundings.mounting
        self._camera = Camera.of(mounting, arm.length, EYE, LOOK_AT)
        self._light = LIGHT @ mounting.turn
        height = OVERSAMPLING * SIZE[1]
        self._focal_length = height / FIELD_HEIGHT / arm.length * self._camera.distance

    def frame(self, trace: Trace, step: int) -> Image.Image:
        """Image of the arm at one step of a run."""
        size = (OVERSAMPLING * SIZE[0], OVERSAMPLING * SIZE[1])
        image = Image.new("RGB", size, BACKGROUND)
        draw = ImageDraw.Draw(image)
        self._draw_ground(draw)
        self._draw_line(draw, trace.desired_path, DESIRED)
        self._draw_line(draw, trace.followed_path[: step + 1], REAL)
        for sphere in trace.spheres(step):
            depth = self.project(sphere[:3])[2]
            radius = self._focal_length * sphere[3] / depth / OVERSAMPLING
            self._draw_dot(draw, sphere[:3], radius, BALL, OBSTACLE)
        if np.isfinite(trace.states[step]).all():
            self._draw_arm(draw, trace.states[step])
        self._draw_target(draw, trace, step)
        text = f"{trace.label}   {trace.times[step] - trace.times[0]:.1f} s"
        draw.text((16, size[1] - 44), text, MUTED, font_size=26)
        return image.resize(SIZE, Image.Resampling.LANCZOS)

    def project(self, points: Points) -> Points:
        """Columns and rows [painted pixels] and depths [m] of points, base frame."""
        right, up, depth = self._camera.coordinates(points)
        center = OVERSAMPLING * np.array(SIZE) / 2
        scale = self._focal_length / depth
        return np.stack(
            [center[0] + scale * right, center[1] - scale * up, depth], axis=-1
        )

    def _draw_ground(self, draw: ImageDraw.ImageDraw) -> None:
        """Draw the grid, the names of its axes, and gravity."""
        for ends in self._surroundings.grid:
            self._draw_line(draw, ends, GRID, OVERSAMPLING)
        for name, position in self._surroundings.names.items():
            self._draw_text(draw, name, position)
        arrow = self._surroundings.arrow
        if arrow is None:
            return
        self._draw_line(draw, arrow, INK, 3 * OVERSAMPLING)
        self._draw_dot(draw, arrow[1], 5, INK)
        gap = 0.06 * self._length * self._surroundings.mounting.gravity
        self._draw_text(draw, "gravity", arrow[0] - gap)

    def _draw_target(self, draw: ImageDraw.ImageDraw, trace: Trace, step: int) -> None:
        """Draw the desired position and a line along the desired axis."""
        axis = trace.desired_axes[step, trace.pointing_module]
        position = trace.desired_path[step]
        tip = position + AXIS_LENGTH * self._length * axis
        self._draw_line(draw, np.stack([position, tip]), DESIRED)
        self._draw_dot(draw, position, 8, BACKGROUND, INK)
        self._draw_dot(draw, position, 6, DESIRED, INK)

    def _draw_arm(self, draw: ImageDraw.ImageDraw, states: States) -> None:
        """Draw the faces that are turned to the camera, the farthest first."""
        triangles = []
        colors = []
        lifts = []
        vertices = self._mesh.vertices(states)
        for piece, corners in zip(self._mesh.pieces, vertices, strict=True):
            faces = corners[piece.faces]
            triangles.append(faces)
            colors.append(self._shade(faces, piece.color))
            lifts.append(np.full(len(faces), piece.lift))
        places = self.project(np.concatenate(triangles))
        shades = np.concatenate(colors)
        nearness = np.concatenate(lifts) - places[..., 2].mean(axis=1)
        for face in np.argsort(nearness):
            corners = places[face, :, :2]
            (a, b), (c, d) = corners[1:] - corners[0]
            if a * d < b * c:  # faces the camera, for rows run downward
                draw.polygon([tuple(corner) for corner in corners], tuple(shades[face]))

    def _shade(self, triangles: Points, color: str):
        """Colors of faces in soft light from above, 0 to 255, shape (faces, 3)."""
        first = triangles[:, 1] - triangles[:, 0]
        second = triangles[:, 2] - triangles[:, 0]
        normals = unit(np.cross(first, second))
        brightness = 0.68 + 0.36 * np.clip(normals @ self._light, 0.0, 1.0)
        return np.clip(brightness[:, None] * rgb(color), 0, 255).astype(int)

    def _draw_line(
        self,
        draw: ImageDraw.ImageDraw,
        points: Points,
        color: str,
        width: int = 2 * OVERSAMPLING,
    ) -> None:
        """Draw a line through all finite points."""
        finite = points[np.isfinite(points).all(axis=-1)]
        if len(finite) > 1:
            places = [tuple(place[:2]) for place in self.project(finite)]
            draw.line(places, color, width, joint="curve")

    def _draw_dot(
        self,
        draw: ImageDraw.ImageDraw,
        point: Point,
        radius: float,
        fill: str,
        outline: str | None = None,
    ) -> None:
        """Draw a disc with a radius in pixels of the video."""
        if np.isfinite(point).all():
            place = tuple(self.project(point)[:2])
            draw.circle(place, OVERSAMPLING * radius, fill, outline, OVERSAMPLING)

    def _draw_text(self, draw: ImageDraw.ImageDraw, text: str, point: Point) -> None:
        place = tuple(self.project(point)[:2])
        draw.text(place, text, MUTED, font_size=24, anchor="mm")


def _write_gif(frames: Iterator[Image.Image], path: Path, seconds: float) -> Path:
    """Write frames that are each shown for some seconds."""
    first, *others = (
        frame.quantize(GIF_COLORS, dither=Image.Dither.NONE) for frame in frames
    )
    content = BytesIO()
    first.save(
        content,
        "GIF",
        save_all=True,
        append_images=others,
        duration=round(1000 * seconds),
        loop=0,
        optimize=True,
    )
    return write_atomically(content.getvalue(), path)


def _write_mp4(frames: Iterator[Image.Image], path: Path, seconds: float) -> Path:
    """Write frames that are each shown for some seconds, with ffmpeg."""
    with TemporaryDirectory() as folder:
        for number, frame in enumerate(frames):
            frame.save(Path(folder) / f"{number:05d}.png")
        video = Path(folder) / "video.mp4"
        source = ["-framerate", f"{1 / seconds:.3f}", "-i", f"{folder}/%05d.png"]
        result = subprocess.run(
            ["ffmpeg", "-loglevel", "error", *source, "-pix_fmt", "yuv420p", video],
            capture_output=True,
            text=True,
            check=False,
        )
        if result.returncode != 0:
            raise S2C2AError(
                f"ffmpeg cannot write the video: {result.stderr.strip()}. "
                "Remove ffmpeg from the PATH to get a GIF."
            )
        return write_atomically(video.read_bytes(), path)
