"""Make the generated pages of docs/reference.

Run `python -m tools.make_reference` from the root of the repository.
"""

from pathlib import Path

from tools.pages import ROOT
from tools.reference_api import api_pages
from tools.reference_commands import commands_page
from tools.reference_episodes import episodes_page
from tools.reference_recipe import recipe_page

FOLDER = ROOT / "docs" / "reference"


def pages() -> dict[Path, str]:
    """Text of every generated page, by its file."""
    api = {FOLDER / "api" / name: text for name, text in api_pages().items()}
    return api | {
        FOLDER / "commands.md": commands_page(),
        FOLDER / "episodes.md": episodes_page(),
        FOLDER / "recipe.md": recipe_page(),
    }


def main() -> None:
    """Write the pages."""
    for path, text in pages().items():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
