"""The page on the architecture quotes the code as it is."""

import inspect
from pathlib import Path

from s2c2a.planning import Outcome
from s2c2a.runtime import Loop

PAGE = Path(__file__).parents[1] / "docs" / "contribute" / "architecture.md"


def test_the_control_step_on_the_page_is_the_one_in_the_code():
    assert inspect.getsource(Loop._control_step) in PAGE.read_text(encoding="utf-8")


def test_every_planner_outcome_stands_on_the_page():
    page = PAGE.read_text(encoding="utf-8")
    for outcome in Outcome:
        assert f"| {outcome.value} | `{outcome.name}` | {outcome.sentence} |" in page
