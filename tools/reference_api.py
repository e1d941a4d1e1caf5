"""Pages of the Python API: public names of each package, described by docstrings."""

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import griffe

from tools.api_pages import PAGES, Page
from tools.markdown import first_paragraph, header, linked, table
from tools.pages import ROOT

FOLDER = "reference/api"
INDEX = """# Python API

The pages follow the data: an arm is described and moved, its motion recorded, its models
learned; then its state is estimated, a configuration planned, and an action chosen.
Names on these pages are public: import them from the package that the page names. All
quantities are in SI units, angles in radians. [Architecture](../../contribute/architecture.md)
shows how the packages depend on each other.
"""
KINDS = {
    "Functions": griffe.Kind.FUNCTION,
    "Classes": griffe.Kind.CLASS,
    "Values": griffe.Kind.ATTRIBUTE,
}
"""Headings of a page, and what stands below them."""


@dataclass(frozen=True)
class Name:
    """A public name.

    Attributes:
        path: by which the page refers to it.
        documented: its definition.
    """

    path: str
    documented: griffe.Object


def api_pages() -> dict[str, str]:
    """Text of every page, by the name of its file."""
    seen: set[str] = set()
    texts = {}
    rows = []
    for page in PAGES:
        names = []
        for name in _names_of_page(page):
            # a name that two packages export is described once
            if name.documented.path not in seen:
                seen.add(name.documented.path)
                names.append(name)
        texts[page.file] = _text(page, _in_order(page, names))
        packages = ", ".join(f"`{package}`" for package in page.packages)
        rows.append((f"[{page.title}]({page.file})", packages, page.purpose))
    index = table(("page", "package", "content"), rows)
    texts["index.md"] = "\n".join((header("tools/api_pages.py"), INDEX, index))
    return texts


def _in_order(page: Page, names: list[Name]) -> list[Name]:
    """Names that the opening mentions come first."""

    def place(name: Name) -> int:
        found = page.text.find(f"`{name.documented.name}`")
        return found if found >= 0 else len(page.text)

    return sorted(names, key=place)


def public_names(package: str) -> list[str]:
    """Names that a package or module offers: defined here, or imported from another.

    Names that `__getattr__` imports on first use belong to them.
    """
    module = _find(package)
    lazy = module.members.get("_MATPLOTLIB_MODULES")
    names = [name for name in module.members if _is_public(module, name)]
    return names + (list(ast.literal_eval(str(lazy.value))) if lazy else [])


def _is_public(module: griffe.Object, name: str) -> bool:
    if name.startswith("_"):
        return False
    member = module.members[name]
    if not member.is_alias:
        # a module is no name of its package; type variables and limits of checks are not
        return not member.is_module and bool(member.docstring)
    if not module.is_init_module:
        return False
    target = member.target_path
    return target.startswith("s2c2a.") and not _find(target).is_module


def _names_of_page(page: Page) -> Iterator[Name]:
    for package in page.packages:
        for name in public_names(package):
            path = _path(package, name)
            yield Name(path, _find(path))
    for path in page.more:
        yield Name(path, _find(path))


def _path(package: str, name: str) -> str:
    """Path of a name; of one that is imported on first use, where it is defined."""
    module = _find(package)
    if name in module.members:
        return f"{package}.{name}"
    places = ast.literal_eval(str(module.members["_MATPLOTLIB_MODULES"].value))
    return f"{package}.{places[name]}.{name}"


@cache
def _library() -> griffe.Object:
    return griffe.load("s2c2a", search_paths=[ROOT / "src"], allow_inspection=False)


def _find(path: str) -> griffe.Object:
    """The definition behind a path."""
    found = _library()[path.removeprefix("s2c2a.")]
    return found.final_target if found.is_alias else found


def _text(page: Page, names: list[Name]) -> str:
    parts = [
        header("tools/api_pages.py and the package"),
        f"# {page.title}\n",
        f"{page.text.strip()}\n",
        f"```python\n{page.example.strip()}\n```\n",
    ]
    for heading, kind in KINDS.items():
        chosen = [name for name in names if name.documented.kind is kind]
        if not chosen:
            continue
        parts.append(f"## {heading}\n")
        parts.append("\n".join(map(_summary, chosen)) + "\n")
        parts += [f"::: {name.path}\n" for name in chosen]
    return "\n".join(parts)


def _summary(name: Name) -> str:
    """Line of a list; in a table, the site breaks long names in the middle."""
    docstring = name.documented.docstring
    if docstring is None:
        raise SystemExit(f"{name.path} has no docstring")
    link = f"[`{name.documented.name}`][{name.path}]"
    return f"- {link}: {linked(first_paragraph(docstring.value), FOLDER)}"


def package_folders() -> list[str]:
    """Names of all packages below `s2c2a`."""
    folders = (ROOT / "src" / "s2c2a").iterdir()
    return sorted(folder.name for folder in folders if _is_package(folder))


def _is_package(folder: Path) -> bool:
    return (folder / "__init__.py").is_file()
