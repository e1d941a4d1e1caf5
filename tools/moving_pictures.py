"""Make the moving pictures of the front pages and of the gallery, each of one command.

Run `python -m tools.moving_pictures`, or with names of pictures for these alone.
"""

import shlex
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from PIL import Image

from s2c2a.episodes import load_episodes
from s2c2a.integrations.exports.video import VideoStage
from s2c2a.viz import Trace
from s2c2a.viz.mounting import EYE

from tools import ROOT

FOLDER = ROOT / "docs" / "pictures"
FRONT = {
    "around": "s2c2a run reach-2 --weights shipped --guard arm",
    "flee": "s2c2a run flee --weights shipped",
    "word": "s2c2a run examples/soft.csv --weights shipped",
}
"""By name of the picture; README.md and docs/index.md show the command below it."""
GALLERY = {
    "gap": "s2c2a run risk-b --weights shipped --guard arm",
    "follow": "s2c2a run follow --weights shipped",
    "still": "s2c2a run hold-middle --weights shipped",
    "tilt": "s2c2a run tilt-50 --weights shipped",
    "shape": "s2c2a run examples/curve.csv --weights shipped",
    "load": "s2c2a run star --weights shipped --payload 0.05 --known-payload 0.05",
    "helix": "s2c2a run helix --weights shipped",
    "pressure": "s2c2a run circle --arm pneumatic_arm --strategy pcc",
    "planar": "s2c2a run circle --arm planar_finger --strategy pcc",
}
"""Likewise on docs/gallery.md, which also shows the others."""
COMMANDS = FRONT | GALLERY
MAX_BYTES = 1_500_000
"""Of one picture, so that the pages open at once."""
SPEED = 2.0
"""Of the pictures, as a multiple of the run's: a loop takes about ten seconds."""
FRAMES_PER_SECOND = 10.0
"""Half as many look jerky, twice as many double the file."""
SIDE = 440  # pixels of a square picture, for three in a row, also on dense screens
GALLERY_SIDE = 280  # pixels; with the speed and colors, a picture has at most 300 kB
GALLERY_SPEED = 4.0
PALETTE = 224  # colors; fewer show blotches on the balls


@dataclass(frozen=True)
class Shot:
    """What a picture shows of a run.

    Attributes:
        eye: place of the camera, as `EYE` in `viz.mounting`.
        crop: left, upper and right edge of a square in a frame of a video [pixels].
        seconds: shown from the start [s].
        side: of the square picture [pixels].
        speed: as a multiple of the run's.
    """

    eye: tuple[float, float, float] = EYE
    crop: tuple[int, int, int] = (50, 45, 370)
    seconds: float = np.inf
    side: int = GALLERY_SIDE
    speed: float = GALLERY_SPEED


SHOTS = {
    # then it waits at the target
    "around": Shot(seconds=15.0, side=SIDE, speed=SPEED),
    # across the ball's path
    "flee": Shot(eye=(0.4, -2.4, 1.3), side=SIDE, speed=SPEED),
    # faces the word
    "word": Shot(eye=(1.4, -1.6, 2.2), crop=(80, 70, 340), side=SIDE, speed=SPEED),
    "follow": Shot(seconds=32.0),  # before the target leaves the reach
    # with the whole word "gravity"
    "pressure": Shot(crop=(20, 45, 340)),
    "planar": Shot(crop=(20, 45, 340)),
}
"""Of pictures that need another view than `Shot()`."""


def trace_of(command: str) -> Trace:
    """The run that a command makes."""
    with TemporaryDirectory() as folder:
        words = [*shlex.split(command), "--out", folder, "--overwrite"]
        subprocess.run([sys.executable, "-m", *words], check=True, cwd=ROOT)
        (file,) = Path(folder, "runs").glob("*.episodes")
        (episode,), _ = load_episodes(file)
    return Trace(episode, "")


def frames_of(trace: Trace, shot: Shot) -> list[Image.Image]:
    """Frames of a run, evenly spaced in time."""
    stage = VideoStage(trace.episode.arm, shot.eye)
    left, upper, right = shot.crop
    scale = shot.side / (right - left)
    stage.figure.set_dpi(scale * stage.figure.dpi)
    lower = upper + right - left
    box = [round(scale * edge) for edge in (left, upper, right, lower)]
    shown = trace.times - trace.times[0] <= shot.seconds
    stride = round(shot.speed * trace.episode.arm.control_rate / FRAMES_PER_SECOND)
    frames = []
    for step in range(0, np.count_nonzero(shown), stride):
        stage.draw(trace, step)
        stage.figure.canvas.draw()
        pixels = np.asarray(stage.figure.canvas.buffer_rgba())[..., :3]
        frames.append(Image.fromarray(pixels).crop(box))
    return frames


def save_gif(frames: list[Image.Image], path: Path) -> None:
    """Save frames with one palette, which holds the colors of the first and last."""
    ends = np.vstack([frames[0], frames[-1]])
    palette = Image.fromarray(ends).quantize(PALETTE, Image.Quantize.MAXCOVERAGE)
    small = [
        frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames
    ]
    small[0].save(
        path,
        save_all=True,
        append_images=small[1:],
        duration=1000 / FRAMES_PER_SECOND,
        loop=0,
    )


def main(*names: str) -> None:
    """Make the pictures of these names, by default all."""
    for name in names or COMMANDS:
        path = FOLDER / f"{name}.gif"
        frames = frames_of(trace_of(COMMANDS[name]), SHOTS.get(name, Shot()))
        save_gif(frames, path)
        print(f"{path}: {path.stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main(*sys.argv[1:])
