"""The generated pages of the reference are up to date, complete, and their examples run."""

import re
import tomllib
from pathlib import Path

import pytest

from s2c2a.strategies import load_recipe

from tools import ROOT
from tools.make_reference import pages
from tools.markdown import page_titles
from tools.page_blocks import PAGES
from tools.reference_arm import arm_keys

REFERENCE = ROOT / "docs" / "reference"
API_PAGES = sorted((REFERENCE / "api").glob("*.md"))
INTERNAL = {
    "execution": "compiled programs, executors, cache: of every command",
    "measurements": "whether a measured value can be true: Estimation, Recordings of your arm",
    "files": "guarded reading and atomic writing: of every file",
    "plugins": "names of parts: the guide of extending",
    "cli": "the command line: Commands",
    "live": "the page in the browser: s2c2a live and s2c2a view",
    "integrations": "other software: the guides of exports, environments and ROS 2",
}
"""Packages behind a command, without a page."""


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


def test_the_page_of_the_arm_file_ends_with_the_table_of_keys():
    page = (REFERENCE / "arm-file.md").read_text(encoding="utf-8")
    assert page.endswith(arm_keys())


def test_every_package_has_a_page_or_belongs_to_a_command():
    texts = "\n".join(page.read_text(encoding="utf-8") for page in API_PAGES)
    documented = set(re.findall(r"^::: s2c2a\.(\w+)", texts, re.MULTILINE))
    packages = {path.parent.name for path in ROOT.glob("src/s2c2a/*/__init__.py")}
    assert packages == (documented - {"spaces"}) | set(INTERNAL)
    assert not documented & set(INTERNAL)


def test_the_navigation_and_the_overview_list_every_page(made):
    listed = page_titles()
    for path in [*made, *API_PAGES]:
        assert path.relative_to(ROOT / "docs").as_posix() in listed
    overview = (REFERENCE / "api" / "index.md").read_text(encoding="utf-8")
    linked = re.findall(r"\]\((\w+\.md)\)", overview)
    assert {*linked, "index.md"} == {page.name for page in API_PAGES}


def test_every_page_states_its_command(made):
    for text in made.values():
        assert text.startswith("<!-- Made by `python -m tools.make_reference` from ")


def test_the_page_of_commands_has_a_section_for_every_command(made):
    text = made[REFERENCE / "commands.md"]
    sections = set(re.findall(r"\{ #([a-z-]+) \}", text))
    linked = set(re.findall(r"\]\(#([a-z-]+)\)", text))
    assert sections == linked
    assert {"run", "collect", "arm-check", "motors-home", "reproduce"} <= sections
    # a section is read at one glance
    assert len(text.splitlines()) < 24 * len(sections)


def test_the_first_example_of_recipe_files_is_a_recipe(made, tmp_path):
    example = re.search(r"```toml\n(.*?)```", made[REFERENCE / "recipe.md"], re.DOTALL)
    (tmp_path / "mine.toml").write_text(example[1], encoding="utf-8")
    recipe = load_recipe(tmp_path / "mine.toml")
    assert recipe.episodes == tomllib.loads(example[1])["episodes"]


def test_meanings_of_keys_are_complete(made):
    for text in (made[REFERENCE / "recipe.md"], made[REFERENCE / "commands.md"]):
        empty = [line for line in text.splitlines() if line.endswith("|  |")]
        assert not empty


@pytest.mark.slow
@pytest.mark.parametrize("page", API_PAGES, ids=lambda page: page.stem)
def test_examples_run(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    document = PAGES.parse(page)
    for example in document:
        example.evaluate()
    assert document.namespace or page.stem == "index"
