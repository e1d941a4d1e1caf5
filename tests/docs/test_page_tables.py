"""Figures of README and documentation are those of the rows in `results/`."""

import html
import re
from collections.abc import Iterator

import pytest

from s2c2a.viz.colors import PALETTE

from tools import ROOT
from tools.inline_figures import FIGURES
from tools.page_tables import TABLES
from tools.results_pictures import FOLDER, MODELS, PICTURES, values_of
from tools.results_tables import find_row
from tools.write_tables import FIGURE, MARKED, pages_with_tables, written

README = ROOT / "README.md"
RESULT = re.compile(r"\d+\.\d+|\d+ ?(?:%|(?:cm|mm|deg|ms|MiB|times)\b)")
"""A decimal, or a number with a unit of errors, shares or times of a step."""
COMMAND = re.compile(r"`(?:s2c2a|python|make) [^`]*`|`\w+\.py`")
UNREAD = re.compile(
    r"<!--.*?-->|^```.*?^```|\]\([^)]*\)|\[?version \d[\d.]*|https?:\S+",
    re.DOTALL | re.MULTILINE,
)
"""Comments, blocks of code, addresses and versions."""
WITHOUT_ROW = {
    "docs/results/protocol.md": "states what is run and how it is scored, no outcome",
    "docs/results/failed-experiments.md": "outcomes of code that is gone",
    "Python 3.11 or newer": "a version",
}
"""Pages, or parts of a statement, whose numbers have neither row nor command."""


def statements(text: str) -> Iterator[str]:
    """Paragraphs, items of lists and lines of tables that are written by hand."""
    by_hand = UNREAD.sub("", FIGURE.sub("", MARKED.sub("", text)))
    yield from re.split(r"\n\s*\n|\n(?=[|-])", by_hand)


def numbers_without_source(text: str) -> list[str]:
    """Statements with a number that is of no row, and with no command beside it."""
    return [
        statement.strip()
        for statement in statements(text)
        if not COMMAND.search(statement)
        if RESULT.search(re.sub(r"`[^`]*`", "", statement))
    ]


@pytest.mark.parametrize("page", [*pages_with_tables()], ids=str)
def test_tables_of_a_page_agree_with_the_rows(page):
    text = page.read_text(encoding="utf-8")
    assert text == written(text), "run python -m tools.write_tables"


def test_no_figure_begins_a_line():
    """A comment there would end the paragraph."""
    for page in pages_with_tables():
        text = page.read_text(encoding="utf-8")
        assert not re.search(r"^<!-- figure", text, re.MULTILINE), page


def test_every_table_stands_on_a_page():
    pages = [page.read_text(encoding="utf-8") for page in pages_with_tables()]
    shown = {found["name"] for page in pages for found in MARKED.finditer(page)}
    assert shown == set(TABLES)
    figures = {found["name"] for page in pages for found in FIGURE.finditer(page)}
    assert figures == set(FIGURES)


def test_the_readme_is_short():
    assert len(README.read_text(encoding="utf-8").splitlines()) <= 90


def test_every_picture_of_results_shows_the_rows():
    folder = ROOT / "docs" / "results"
    pages = [page.read_text(encoding="utf-8") for page in folder.glob("*.md")]
    for name, bars in PICTURES.items():
        drawn = (FOLDER / f"{name}.svg").read_text(encoding="utf-8")
        is_present = values_of(bars()) in html.unescape(drawn)
        assert is_present, f"{name}: run python -m tools.write_tables"
        assert any(f"{name}.svg" in page for page in pages)


def test_pictures_of_results_have_the_colors_of_figures_and_one_for_each_model():
    of_model = {}
    for name, bars in PICTURES.items():
        picture = (FOLDER / f"{name}.svg").read_text(encoding="utf-8")
        # bars, and their mark in the legend at the end
        fills = re.findall(r"fill: (#[0-9a-f]{6})", picture)
        shown = list(bars().series)
        for series, color in zip(shown, fills[-len(shown) :], strict=True):
            assert color in PALETTE
            if series in MODELS:
                of_model.setdefault(series, set()).add(color)
    assert all(len(colors) == 1 for colors in of_model.values())
    assert set(of_model) == set(MODELS)


def test_every_number_on_pages_of_results_has_a_row_or_a_command():
    found = [
        f"{page.relative_to(ROOT)}: {statement}"
        for page in (README, *sorted((ROOT / "docs" / "results").glob("*.md")))
        for statement in numbers_without_source(page.read_text(encoding="utf-8"))
    ]
    unexplained = [
        each for each in found if not any(key in each for key in WITHOUT_ROW)
    ]
    assert unexplained == []
    unused = [key for key in WITHOUT_ROW if not any(key in each for each in found)]
    assert unused == []
    assert len(WITHOUT_ROW) <= 10


@pytest.mark.parametrize(
    ("text", "count"),
    [
        ("The arm errs by 3 mm.", 1),
        ("It is 0.5 of that\n\nand 5% more.", 2),
        ("| a | 3 mm | `bench_step.py` |\n| b | 4 mm | |", 1),
        ("`s2c2a bench` says 3 ms.", 0),
        ("It is <!-- figure: a -->3 mm<!-- end --> of `0.5`.", 0),
        ("<!-- table: a -->\n| 0.5 |\n<!-- end of table -->", 0),
        ("Five seeds, 50 g, of version 0.3.", 0),
    ],
)
def test_a_number_is_found_by_its_unit_or_its_decimals(text, count):
    assert len(numbers_without_source(text)) == count


def test_a_missing_row_is_named():
    with pytest.raises(LookupError, match=r"best/tracking\.json: 0 rows"):
        find_row("best/tracking.json", task="circles")
