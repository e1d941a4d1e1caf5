"""Make the moving pictures of README.md and docs/index.md, each of one command.

Run `python -m tools.front_pictures`, or with names of pictures for these alone.
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
COMMANDS = {
    "around": "s2c2a run reach-2 --weights shipped --guard arm",
    "flee": "s2c2a run flee --weights shipped",
    "word": "s2c2a run examples/soft.csv --weights shipped",
}
"""By name of the picture; both pages show the command below it."""
MAX_BYTES = 1_500_000
"""Of one picture, so that the pages open at once."""
SPEED = 2.0
"""Of the pictures, as a multiple of the run's: a loop takes about ten seconds."""
FRAMES_PER_SECOND = 10.0
"""Half as many look jerky, twice as many double the file."""
SIDE = 440  # pixels of a square picture, for three in a row, also on dense screens
PALETTE = 224  # colors; fewer show blotches on the balls


@dataclass(frozen=True)
class Shot:
    """What a picture shows of a run.

    Attributes:
        eye: place of the camera, as `EYE` in `viz.mounting`.
        crop: left, upper and right edge of a square in a frame of a video [pixels].
        seconds: shown from the start [s].
    """

    eye: tuple[float, float, float] = EYE
    crop: tuple[int, int, int] = (50, 45, 370)
    seconds: float = np.inf


SHOTS = {
    "around": Shot(seconds=9.0),  # then it waits at the target
    "flee": Shot(eye=(0.4, -2.4, 1.3)),  # across the ball's path
    "word": Shot(eye=(1.4, -1.6, 2.2), crop=(80, 70, 340)),  # faces the word
}


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
    scale = SIDE / (right - left)
    stage.figure.set_dpi(scale * stage.figure.dpi)
    lower = upper + right - left
    box = [round(scale * edge) for edge in (left, upper, right, lower)]
    shown = trace.times - trace.times[0] <= shot.seconds
    stride = round(SPEED * trace.episode.arm.control_rate / FRAMES_PER_SECOND)
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
        frames = frames_of(trace_of(COMMANDS[name]), SHOTS[name])
        save_gif(frames, path)
        print(f"{path}: {path.stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main(*sys.argv[1:])
