"""Moving pictures of README, first page and gallery, each with the command that makes it."""

import re

import pytest

from tools import ROOT
from tools.moving_pictures import COMMANDS, FOLDER, FRONT, MAX_BYTES, trace_of


def shown_on(page: str) -> dict[str, str]:
    """Commands of the tables of a page, by the picture above them."""
    rows = [
        line.strip("| ").split(" | ")
        for line in (ROOT / page).read_text(encoding="utf-8").splitlines()
        if line.startswith("| ")
    ]
    found = {}
    for pictures, _, commands in zip(rows, rows[1:], rows[2:], strict=False):
        if pictures[0].endswith(".gif)"):
            names = [re.search(r"(\w+)\.gif\)$", picture)[1] for picture in pictures]
            shown = [command.strip("`") for command in commands]
            found |= dict(zip(names, shown, strict=True))
    return found


@pytest.mark.parametrize(
    ("page", "commands"),
    [("README.md", FRONT), ("docs/index.md", FRONT), ("docs/gallery.md", COMMANDS)],
)
def test_every_moving_picture_has_its_command_below_it(page, commands):
    assert shown_on(page) == commands


@pytest.mark.parametrize("name", COMMANDS)
def test_a_moving_picture_is_small(name):
    largest = MAX_BYTES if name in FRONT else MAX_BYTES / 5
    assert (FOLDER / f"{name}.gif").stat().st_size < largest


@pytest.mark.slow
@pytest.mark.parametrize("name", ["pressure", "planar", "shape"])
def test_a_command_of_the_gallery_makes_a_run(name):
    trace = trace_of(COMMANDS[name])
    assert len(trace.times) > 100
