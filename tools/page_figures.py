"""Copy figures that the commands of a page wrote to docs/pictures, smaller.

Run the blocks of the page in a directory, then

    python tools/page_figures.py DIRECTORY

for each page of `FIGURES`: the script copies every listed figure that it finds there.
"""

import sys
from pathlib import Path

from PIL import Image

PICTURES = Path(__file__).parents[1] / "docs" / "pictures"
WIDTH = 1200  # pixels
COLORS = 128  # figures have few colors, and a palette makes them a third as large
FIGURES = {
    "hanging.png": "your-arm-drawing.png",
    "hanging.episodes.png": "your-arm-workspace.png",
    "runs/hanging/hanging.png": "your-arm-circle.png",
    "runs/risk-a/twin_arm.png": "obstacles-risk-a.png",
    "runs/post/twin_arm.png": "obstacles-post.png",
    "runs/triangle/twin_arm.png": "first-task-triangle.png",
    "runs/flower/twin_arm.png": "first-task-flower.png",
    "runs/demo/twin_arm.png": "first-run.png",
    "reach.png": "reach.png",
    "tour-arm.png": "tour-arm.png",
    "tour-run.png": "tour-run.png",
}
"""Figure in a page's directory, and its name in docs/pictures."""


def copy_figure(source: Path, target: Path) -> None:
    """Reduce a figure to the width of the page and a palette."""
    picture = Image.open(source).convert("RGB")
    height = round(picture.height * WIDTH / picture.width)
    small = picture.resize((WIDTH, height), Image.Resampling.LANCZOS)
    small.quantize(COLORS).save(target, optimize=True)


def copy_figures(folder: Path) -> list[Path]:
    """Copy all known figures of a directory; return the new files."""
    copied = []
    for name, target in FIGURES.items():
        if (folder / name).is_file():
            copy_figure(folder / name, PICTURES / target)
            copied.append(PICTURES / target)
    return copied


if __name__ == "__main__":
    for argument in sys.argv[1:]:
        for path in copy_figures(Path(argument)):
            print(path)
