"""Make the moving pictures of README.md and docs/index.md, each of one command.

Run `python -m tools.front_pictures`, or with names of pictures for these alone.
"""

import shlex
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from PIL import Image

from s2c2a.episodes import load_episodes
from s2c2a.viz import Trace
from s2c2a.viz.mounting import EYE
from s2c2a.viz.video import VideoStage

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
SPEED = 3.0
"""Of the pictures, as a multiple of the run's: a loop takes about ten seconds."""
FRAMES_PER_SECOND = 10.0
"""Half as many look jerky, twice as many double the file."""
PALETTE = 48  # colors; fewer show steps on the balls
CROP = (10, 0, 410, 400)
"""Left, upper, right and lower edge [pixels]: a square, for three pictures in a row."""
EYES = {"flee": (0.4, -2.4, 1.3), "word": (1.4, -1.6, 2.2)}
"""Cameras as `EYE` in `viz.mounting`: across the ball's path, and facing the word."""


def trace_of(command: str) -> Trace:
    """The run that a command makes."""
    with TemporaryDirectory() as folder:
        words = [*shlex.split(command), "--out", folder, "--overwrite"]
        subprocess.run([sys.executable, "-m", *words], check=True, cwd=ROOT)
        (file,) = Path(folder, "runs").glob("*.episodes")
        (episode,), _ = load_episodes(file)
    return Trace(episode, "")


def frames_of(trace: Trace, eye: tuple[float, float, float]) -> list[Image.Image]:
    """Frames of a run, evenly spaced in time, seen by a camera."""
    stage = VideoStage(trace.episode.arm, eye)
    control_rate = trace.episode.arm.control_rate
    stride = round(SPEED * control_rate / FRAMES_PER_SECOND)
    frames = []
    for step in range(0, trace.times.size, stride):
        stage.draw(trace, step)
        stage.figure.canvas.draw()
        pixels = np.asarray(stage.figure.canvas.buffer_rgba())[..., :3]
        frames.append(Image.fromarray(pixels).crop(CROP))
    return frames


def save_gif(frames: list[Image.Image], path: Path) -> None:
    """Save frames with the palette of the last one, which shows the whole path."""
    palette = frames[-1].quantize(PALETTE)
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
        frames = frames_of(trace_of(COMMANDS[name]), EYES.get(name, EYE))
        save_gif(frames, path)
        print(f"{path}: {path.stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main(*sys.argv[1:])
