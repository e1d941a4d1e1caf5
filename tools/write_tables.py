"""Write tables, figures and pictures of the documentation from the rows in `results/`.

Run `python -m tools.write_tables` after rows changed. A page marks the place of a table
with `<!-- table: NAME -->` and `<!-- end of table -->`, and a figure in a sentence with
`<!-- figure: NAME -->` and `<!-- end -->`. Pictures are those of
`tools/results_pictures.py`.
"""

import re
import sys
from collections.abc import Iterator
from pathlib import Path

from tools import ROOT, all_pages
from tools.inline_figures import FIGURES
from tools.page_tables import TABLES
from tools.results_pictures import write_pictures

MARKED = re.compile(
    r"(<!-- table: (?P<name>[\w-]+) -->\n).*?(<!-- end of table -->)", re.DOTALL
)

FIGURE = re.compile(r"(<!-- figure: (?P<name>[\w-]+) -->).*?(<!-- end -->)", re.DOTALL)


def written(page: str) -> str:
    """A page with its tables and figures made from the present rows.

    Raises:
        KeyError: no function makes a table or figure of this name.
    """

    def with_figure(found: re.Match[str]) -> str:
        return f"{found[1]}{FIGURES[found['name']]()}{found[3]}"

    def replaced(found: re.Match[str]) -> str:
        return f"{found[1]}\n{TABLES[found['name']]()}\n{found[3]}"

    return FIGURE.sub(with_figure, MARKED.sub(replaced, page))


def pages_with_tables() -> Iterator[Path]:
    """Pages that show rows of `results/`."""
    for page in all_pages():
        text = page.read_text(encoding="utf-8")
        if MARKED.search(text) or FIGURE.search(text):
            yield page


def main() -> None:
    """Write all of them."""
    write_pictures()
    for page in pages_with_tables():
        text = page.read_text(encoding="utf-8")
        page.write_text(written(text), encoding="utf-8")
        print(page.relative_to(ROOT), file=sys.stderr)


if __name__ == "__main__":
    main()
