"""Counts in texts: "1 episode", never "1 episodes"."""

import re
from pathlib import Path

import pytest

from s2c2a.errors import counted

ROOT = Path(__file__).parents[1]
NOUNS = (
    "cable|column|cycle|epoch|episode|frame|module|recording|row|run|sample|servo|step"
)
COUNT_AND_NOUN = re.compile(
    rf"(?<! of )(?<!the )\{{(?!len\([A-Z])[a-z][^{{}}:!]*\}} "
    rf"(?:training |usable |valid )?(?:{NOUNS})s\b(?!.*at (?:most|least))"
)
"""Beside "5 of 6 rows" and bounds, which are larger than one."""
OTHERS = {
    "(self.modules)} modules": "in the sense of: for each of them",
    "(outside)} steps": "as in 5 of 6",
    "(found)} servos answer": "is for several",
    "protocol} servos": "no count but a name",
    "brand} servos": "no count but a name",
    "{share} steps": "no count but a text",
    "{counts} rows": "no count but a list",
    "at least {least}": "a bound",
    "at most {": "a bound",
}
"""Parts of texts that match, and why they are right."""


@pytest.mark.parametrize(
    ("count", "noun", "text"),
    [
        (1, "row", "1 row"),
        (0, "row", "0 rows"),
        (2, "swapped body", "2 swapped bodies"),
    ],
)
def test_a_count_is_followed_by_its_noun(count, noun, text):
    assert counted(count, noun) == text


def test_texts_count_things_by_one_function():
    found = [
        f"{file.relative_to(ROOT)}: {line.strip()}"
        for folder in ("src", "experiments")
        for file in sorted((ROOT / folder).rglob("*.py"))
        for line in file.read_text("utf-8").splitlines()
        if COUNT_AND_NOUN.search(line) or "(s) " in line
        if not any(part in line for part in OTHERS)
    ]
    assert found == []
