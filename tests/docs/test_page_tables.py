"""Tables of README and documentation are those of the rows in `results/`."""

import re

import pytest

from tools import ROOT
from tools.inline_figures import FIGURES
from tools.page_tables import TABLES
from tools.results_tables import find_row
from tools.write_tables import FIGURE, MARKED, pages_with_tables, written

README = (ROOT / "README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("page", [*pages_with_tables()], ids=str)
def test_tables_of_a_page_agree_with_the_rows(page):
    text = page.read_text(encoding="utf-8")
    assert text == written(text), "run python -m tools.write_tables"


def test_every_table_stands_on_a_page():
    pages = [page.read_text(encoding="utf-8") for page in pages_with_tables()]
    shown = {found["name"] for page in pages for found in MARKED.finditer(page)}
    assert shown == set(TABLES)
    figures = {found["name"] for page in pages for found in FIGURE.finditer(page)}
    assert figures == set(FIGURES)


def test_the_readme_is_short():
    assert len(README.splitlines()) <= 90


def test_errors_in_the_readme_come_from_results():
    prose = MARKED.sub("", README.split("## Results")[1])
    assert not re.findall(r"\d[\d.]* (?:cm|mm|deg|%|times)", prose)


def test_a_missing_row_is_named():
    with pytest.raises(LookupError, match=r"best/tracking\.json: 0 rows"):
        find_row("best/tracking.json", task="circles")
