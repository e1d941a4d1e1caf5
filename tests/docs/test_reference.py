"""The generated pages of the reference are up to date, complete, and their examples run."""

import re
import tomllib
from pathlib import Path

import pytest

from s2c2a.strategies import load_recipe

from tools.api_pages import INTERNAL, PAGES
from tools.make_reference import pages
from tools.markdown import page_titles
from tools.reference_api import package_folders

ROOT = Path(__file__).parents[2]
REFERENCE = ROOT / "docs" / "reference"


@pytest.fixture(scope="module")
def made() -> dict[Path, str]:
    return pages()


def test_pages_are_what_the_tool_makes(made):
    old = [
        str(path.relative_to(ROOT))
        for path, text in made.items()
        if not path.is_file() or path.read_text(encoding="utf-8") != text
    ]
    assert not old, "run `python -m tools.make_reference`"


def test_the_tool_makes_every_page_of_the_api(made):
    files = set((REFERENCE / "api").glob("*.md"))
    assert files == {path for path in made if path.parent.name == "api"}


def test_every_package_has_a_page_or_belongs_to_a_command():
    documented = {package.split(".")[1] for page in PAGES for package in page.packages}
    assert set(package_folders()) == (documented - {"spaces"}) | set(INTERNAL)
    assert not documented & set(INTERNAL)


def test_the_navigation_lists_every_generated_page(made):
    listed = page_titles()
    for path in made:
        assert path.relative_to(ROOT / "docs").as_posix() in listed


def test_every_page_states_its_command(made):
    for text in made.values():
        assert text.startswith("<!-- Made by `python -m tools.make_reference` from ")


def test_the_page_of_commands_has_a_section_for_every_command(made):
    text = made[REFERENCE / "commands.md"]
    sections = set(re.findall(r"\{ #([a-z-]+) \}", text))
    linked = set(re.findall(r"\]\(#([a-z-]+)\)", text))
    assert sections == linked
    assert {"run", "collect", "arm-check", "motors-home", "reproduce-all"} <= sections
    assert len(text.splitlines()) < 1500


def test_the_first_example_of_recipe_files_is_a_recipe(made, tmp_path):
    example = re.search(r"```toml\n(.*?)```", made[REFERENCE / "recipe.md"], re.DOTALL)
    (tmp_path / "mine.toml").write_text(example[1], encoding="utf-8")
    recipe = load_recipe(tmp_path / "mine.toml")
    assert recipe.episodes == tomllib.loads(example[1])["episodes"]


def test_meanings_of_keys_are_complete(made):
    for text in (made[REFERENCE / "recipe.md"], made[REFERENCE / "commands.md"]):
        empty = [line for line in text.splitlines() if line.endswith("|  |")]
        assert not empty


@pytest.mark.parametrize("page", PAGES, ids=[page.file for page in PAGES])
def test_examples_run(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    exec(compile(page.example, page.file, "exec"), {"__name__": "example"})
