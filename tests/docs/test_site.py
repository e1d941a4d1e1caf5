"""The documentation builds strictly, and its links lead somewhere without a network."""

import importlib
import inspect
import re
import shutil
import subprocess
import sys
import tomllib
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import pytest
from markdown import markdown

from tools import ROOT
from tools.check_site import findings

SITE = tomllib.loads((ROOT / "zensical.toml").read_text(encoding="utf-8"))["project"]
WHOLE = '<span class="whole">{}</span>'
FIRST = (ROOT / "docs/index.md").read_text(encoding="utf-8")
OURS = [name for name in SITE["markdown_extensions"] if name.startswith("tools.")]


def public_names(package: str) -> Iterator[tuple[str, str]]:
    """Classes and functions that a package offers: where they are defined, and the path."""
    module_of_package = importlib.import_module(package)
    for name in dir(module_of_package):  # names that load when used, too
        value = getattr(module_of_package, name)
        module = getattr(value, "__module__", None) or ""
        is_ours = module.startswith("s2c2a.") and not inspect.ismodule(value)
        if is_ours and not name.startswith("_"):
            yield f"{module}.{name}", f"{package}.{name}"


def packages_with_a_page() -> list[str]:
    """Packages that the pages of the API show as a whole."""
    texts = [page.read_text() for page in (ROOT / "docs/reference/api").glob("*.md")]
    shown = re.findall(r"^::: ([\w.]+)", "\n".join(texts), re.MULTILINE)
    return [name for name in shown if (ROOT / "src" / name.replace(".", "/")).is_dir()]


def undescribed_names(site: Path) -> list[str]:
    """Public names that no page of the API describes by one of their paths."""
    built = [page.read_text() for page in site.glob("reference/api/*/index.html")]
    anchors = set(re.findall(r'id="(s2c2a[\w.]*)"', "".join(built)))
    paths = defaultdict(set)
    for package in packages_with_a_page():
        for definition, path in public_names(package):
            paths[definition] |= {definition, path}
    assert len(paths) > 200
    return [name for name, names in paths.items() if not names & anchors]


def test_links_between_pages_lead_to_a_file_of_the_documentation():
    lost = []
    for page in (ROOT / "docs").rglob("*.md"):
        for address in re.findall(r"\]\(([^)#\s]+)", page.read_text()):
            target = (page.parent / address).resolve()
            is_there = target.is_file() and target.is_relative_to(ROOT / "docs")
            if ":" not in address and not is_there:
                lost.append(f"{page.relative_to(ROOT)}: {address}")
    assert lost == []


def test_the_first_page_has_pictures_commands_and_python_on_one_screen():
    """They end at 880 of 900 pixels in a browser of 1400."""
    assert "hide: [navigation, toc]" in FIRST
    screen = FIRST.split("\n## ")[0]
    blocks = re.findall(r"```(\w+)\n(.*?)```", screen, re.DOTALL)
    lines = {language: text.count("\n") for language, text in blocks}
    assert screen.count(".gif)") == 3
    assert lines == {"sh": 2, "python": 9}


@pytest.mark.parametrize(
    ("cell", "shown"),
    [
        ("0.24 ± 0.01", "0.24&nbsp;±&nbsp;0.01"),
        ("17; 10.7; 18.0", "17;&nbsp;10.7;&nbsp;18.0"),
        ("0.05 ± 0.01; 0.30 ± 0.05", "0.05&nbsp;±&nbsp;0.01; 0.30&nbsp;±&nbsp;0.05"),
        ("as 3 modules", "as 3 modules"),
        ("`run --a-b 1`", f"<code>run {WHOLE.format('--a-b')} 1</code>"),
        ("`diff-ik`", f"<code>{WHOLE.format('diff-ik')}</code>"),
        ("`a/name-of-a/file.py`", "<code>a/name-of-a/file.py</code>"),
    ],
)
def test_values_of_tables_and_options_of_commands_stay_on_one_line(cell, shown):
    text = markdown(f"| a |\n| --- |\n| {cell} |", extensions=["tables", *OURS])
    assert f"<td>{shown}</td>" in text


@pytest.mark.slow
def test_the_site_builds_strictly_without_dead_links_and_with_every_public_name(
    tmp_path,
):

    for name in ("src", "tools"):
        (tmp_path / name).symlink_to(ROOT / name)
    for name in ("docs", "README.md", "CHANGELOG.md", "examples"):
        source = ROOT / name
        copy = shutil.copytree if source.is_dir() else shutil.copy
        copy(source, tmp_path / name)
    configuration = Path(shutil.copy(ROOT / "zensical.toml", tmp_path))
    build = subprocess.run(
        [Path(sys.executable).with_name("zensical"), "build"],
        cwd=tmp_path,
        env={"NO_COLOR": "1", "PYTHONPATH": ".", "PATH": "/usr/bin:/bin"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert build.returncode == 0, build.stdout + build.stderr
    assert findings(tmp_path / "site", configuration) == []
    assert undescribed_names(tmp_path / "site") == []
