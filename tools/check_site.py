"""Check of the built documentation site: `python -m tools.check_site`.

Reports dead links and anchors, missing pictures, entries of the navigation without a
page, and fonts, scripts, styles and pictures of other hosts: the site works without a
network.
"""

import argparse
import re
import sys
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

from tools import ROOT

SITE = ROOT / "site"
CONFIGURATION = ROOT / "zensical.toml"
LOADING_LINKS = {"stylesheet", "icon", "preload", "modulepreload", "manifest"}
"""Kinds of `link` elements that the browser loads."""
LOADING_TAGS = {
    "img": "src",
    "script": "src",
    "iframe": "src",
    "source": "src",
    "video": "src",
    "audio": "src",
    "embed": "src",
    "object": "data",
}
STYLE_ADDRESS = re.compile(r"""(?:url\(\s*|@import\s+)["']?([^"')\s]+)""")
OTHER_SCHEMES = ("mailto", "tel", "data", "javascript", "blob", "vscode")
NOT_FOUND_PAGE = "404.html"


@dataclass
class Page(HTMLParser):
    """Links and anchors of an HTML page."""

    anchors: set[str] = field(default_factory=set)
    links: list[str] = field(default_factory=list)
    """Addresses that a reader can follow."""
    loaded: list[str] = field(default_factory=list)
    """Addresses that the browser loads with the page."""
    _in_style: bool = False

    def __post_init__(self) -> None:
        super().__init__()

    def handle_starttag(
        self, tag: str, attributes: list[tuple[str, str | None]]
    ) -> None:
        """Collect anchors and addresses of an element."""
        values = {name: value or "" for name, value in attributes}
        self._in_style = tag == "style"
        self.anchors |= {values[name] for name in ("id", "name") if name in values}
        self.loaded += STYLE_ADDRESS.findall(values.get("style", ""))
        if tag == "a" and "href" in values:
            self.links.append(values["href"])
        elif tag == "link" and LOADING_LINKS & set(values.get("rel", "").split()):
            self.loaded.append(values.get("href", ""))
        elif values.get(LOADING_TAGS.get(tag, "")):
            self.loaded.append(values[LOADING_TAGS[tag]])

    def handle_data(self, data: str) -> None:
        """Collect addresses in styles."""
        if self._in_style:
            self.loaded += STYLE_ADDRESS.findall(data)


def findings(site: Path, configuration: Path | None = None) -> list[str]:
    """Everything that is wrong with a built site, one sentence each."""
    found: list[str] = []
    for file in sorted(site.rglob("*.html")):
        if file.name != NOT_FOUND_PAGE:  # its addresses begin at the host
            found += _findings_of_page(site, file)
    for file in sorted(site.rglob("*.css")):
        found += _findings_of_style(site, file)
    if configuration is not None:
        found += _pages_missing(site, configuration)
    return list(dict.fromkeys(found))  # a page repeats its navigation


@cache
def read_page(file: Path) -> Page:
    """Links and anchors of a page."""
    page = Page()
    page.feed(file.read_text(encoding="utf-8"))
    return page


def _findings_of_page(site: Path, file: Path) -> Iterator[str]:
    page = read_page(file)
    name = file.relative_to(site)
    for address in page.links:
        if not _is_elsewhere(address):
            fault = _fault_of_address(site, file, address)
            if fault:
                yield f"{name}: link {address}: {fault}"
    for address in page.loaded:
        fault = _fault_of_loaded(site, file, address)
        if fault:
            yield f"{name}: {address}: {fault}"


def _findings_of_style(site: Path, file: Path) -> Iterator[str]:
    for address in STYLE_ADDRESS.findall(file.read_text(encoding="utf-8")):
        fault = _fault_of_loaded(site, file, address)
        if fault:
            yield f"{file.relative_to(site)}: {address}: {fault}"


def _is_elsewhere(address: str) -> bool:
    """Whether an address is on another host or no page."""
    parts = urlsplit(address)
    return bool(parts.netloc or parts.scheme)


def _fault_of_loaded(site: Path, file: Path, address: str) -> str:
    parts = urlsplit(address)
    if parts.scheme in OTHER_SCHEMES or not (parts.path or parts.netloc):
        return ""
    if parts.scheme or parts.netloc:
        return "is on another host; the site must work without a network"
    return _fault_of_address(site, file, parts._replace(fragment="").geturl())


def _fault_of_address(site: Path, file: Path, address: str) -> str:
    parts = urlsplit(address)
    target = _target(site, file, unquote(parts.path))
    if not target.is_relative_to(site.resolve()):
        return "lies outside of the site"
    if not target.is_file():
        return "does not exist"
    anchor = unquote(parts.fragment)
    is_page = target.suffix == ".html"
    if anchor and is_page and anchor not in read_page(target).anchors:
        return f"{target.relative_to(site.resolve())} has no anchor {anchor}"
    return ""


def _target(site: Path, file: Path, path: str) -> Path:
    """File that an address without host names."""
    if not path:
        return file.resolve()
    start = site if path.startswith("/") else file.parent
    target = (start / path.lstrip("/")).resolve()
    return target / "index.html" if target.is_dir() else target


def _pages_missing(site: Path, configuration: Path) -> Iterator[str]:
    project = tomllib.loads(configuration.read_text(encoding="utf-8"))["project"]
    for source in _sources(project.get("nav", [])):
        page = Path(source).with_suffix("")
        parts = page.parent if page.name == "index" else page
        if not (site / parts / "index.html").is_file():
            yield f"navigation: {source} has no page"


def _sources(entries: list | dict | str) -> Iterator[str]:
    """Names of all Markdown files of a navigation."""
    if isinstance(entries, str):
        yield entries
        return
    inner = entries.values() if isinstance(entries, dict) else entries
    for entry in inner:
        yield from _sources(entry)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the findings; exit status 1 if there are any."""
    parser = argparse.ArgumentParser(
        prog="python -m tools.check_site",
        description="Check the built documentation site.",
    )
    parser.add_argument("site", type=Path, nargs="?", default=SITE)
    site = parser.parse_args(arguments).site
    if not (site / "index.html").is_file():
        print(f"{site} has no index.html; build the site: make docs-site")
        return 1
    found = findings(site, CONFIGURATION)
    for finding in found:
        print(finding)
    count = sum(1 for _ in site.rglob("*.html"))
    print(f"{site}: {count} pages, {len(found)} findings")
    return int(bool(found))


if __name__ == "__main__":
    sys.exit(main())
