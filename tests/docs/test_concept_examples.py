"""The Python examples of the concept pages print what the pages state."""

import re
from pathlib import Path

import numpy as np
import pytest

from marks import slow_after

CONCEPTS = Path(__file__).parents[2] / "docs" / "concepts"
PAGES = ("spaces", "equations", "estimation", "planning")


def python_of(page: str) -> str:
    """All Python blocks of a page, one session."""
    text = (CONCEPTS / f"{page}.md").read_text(encoding="utf-8")
    return "\n".join(
        re.findall(r"^```python\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    )


@pytest.mark.parametrize("page", slow_after(1, PAGES))
def test_a_page_states_what_its_examples_print(page, capsys):
    code = python_of(page)
    stated = re.findall(r"^print\(.*\)  # (.*)$", code, re.MULTILINE)
    assert len(stated) == code.count("print(") > 0
    with np.printoptions():
        exec(compile(code, f"{page}.md", "exec"), {"__name__": "page"})
    assert capsys.readouterr().out.splitlines() == stated
