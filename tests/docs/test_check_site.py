"""The check of the built site finds what is broken."""

import pytest

from tools.check_site import findings

GOOD = (
    '<h1 id="top"><a href="#top">x</a></h1><a href="b/">b</a><a href="b/#part">p</a>'
    '<img src="p.png"><a href="https://example.org/x">elsewhere</a>'
    '<link rel="canonical" href="https://example.org/"><script src="a.js"></script>'
)


@pytest.fixture
def site(tmp_path):
    """A site of two pages without findings."""
    (tmp_path / "b").mkdir()
    (tmp_path / "index.html").write_text(GOOD)
    (tmp_path / "b" / "index.html").write_text('<h2 id="part"><a href="..">up</a></h2>')
    (tmp_path / "a.js").touch()
    (tmp_path / "p.png").touch()
    return tmp_path


def test_a_whole_site_has_no_findings(site):
    assert findings(site) == []


@pytest.mark.parametrize(
    ("addition", "finding"),
    [
        ('<a href="c/">c</a>', "link c/: does not exist"),
        ('<a href="b/#other">b</a>', "b/index.html has no anchor other"),
        ('<a href="../x.html">x</a>', "lies outside of the site"),
        ('<img src="q.png">', "q.png: does not exist"),
        ('<script src="https://cdn.example.org/a.js"></script>', "on another host"),
        ('<link rel="stylesheet" href="//fonts.example.org/f">', "on another host"),
        ("<style>@import 'https://example.org/f.css';</style>", "on another host"),
        ('<p style="background: url(q.png)">', "q.png: does not exist"),
    ],
)
def test_a_broken_address_is_found(site, addition, finding):
    (site / "c.html").write_text(addition)
    (found,) = findings(site)
    assert found.startswith("c.html: ")
    assert finding in found


def test_a_style_sheet_that_loads_a_font_of_another_host_is_found(site):
    (site / "a.css").write_text("@font-face { src: url('https://example.org/f.ttf') }")
    (found,) = findings(site)
    assert found.startswith("a.css: https://example.org/f.ttf")


def test_an_entry_of_the_navigation_without_a_page_is_found(site, tmp_path):
    configuration = tmp_path / "site.toml"
    configuration.write_text(
        "[project]\n"
        'nav = [{ "A" = "index.md" }, { "B" = [{ "B1" = "b/index.md" }, "c.md"] }]\n'
    )
    assert findings(site, configuration) == ["navigation: c.md has no page"]
