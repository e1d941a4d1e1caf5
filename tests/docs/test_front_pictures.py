"""Moving pictures at the top of README and documentation."""

import re

import pytest

from tools import ROOT
from tools.front_pictures import COMMANDS, FOLDER, MAX_BYTES


@pytest.mark.parametrize("page", ["README.md", "docs/index.md"])
def test_every_moving_picture_has_its_command_below_it(page):
    pictures, _, commands, *_ = (
        line.strip("| ").split(" | ")
        for line in (ROOT / page).read_text(encoding="utf-8").splitlines()
        if line.startswith("| ")
    )
    names = [re.search(r"(\w+)\.gif\)$", picture)[1] for picture in pictures]
    shown = [command.strip("`") for command in commands]
    assert dict(zip(names, shown, strict=True)) == COMMANDS


@pytest.mark.parametrize("name", COMMANDS)
def test_a_moving_picture_is_small(name):
    assert (FOLDER / f"{name}.gif").stat().st_size < MAX_BYTES
