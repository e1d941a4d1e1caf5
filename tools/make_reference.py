"""Make the generated pages of docs/reference.

Run `python -m tools.make_reference` from the root of the repository.
"""

from pathlib import Path

from tools import ROOT
from tools.reference_commands import commands_page
from tools.reference_recipe import recipe_page

FOLDER = ROOT / "docs" / "reference"


def pages() -> dict[Path, str]:
    """Text of every generated page, by its file."""
    return {
        FOLDER / "commands.md": commands_page(),
        FOLDER / "recipe.md": recipe_page(),
    }


def main() -> None:
    """Write the pages."""
    for path, text in pages().items():
        path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
