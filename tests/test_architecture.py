"""The pages on architecture and planning quote the code as it is."""

import inspect
from pathlib import Path

from s2c2a.planning import Outcome
from s2c2a.runtime import Loop

DOCS = Path(__file__).parents[1] / "docs"


def test_the_control_step_on_the_page_is_the_one_in_the_code():
    page = (DOCS / "contribute" / "architecture.md").read_text(encoding="utf-8")
    assert inspect.getsource(Loop._control_step) in page


def test_every_planner_outcome_stands_on_the_page():
    page = (DOCS / "concepts" / "planning.md").read_text(encoding="utf-8")
    for outcome in Outcome:
        assert f"| {outcome.value} | `{outcome.name}` | {outcome.sentence} |" in page
