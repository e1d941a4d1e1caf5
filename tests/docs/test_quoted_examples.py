"""Pages quote examples as they are."""

from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(
    ("page", "example"),
    [
        ("get-started/python.md", "03_a_target_that_moves.py"),
        ("guides/ros.md", "extending/ros_client.py"),
    ],
)
def test_a_page_quotes_its_example(page, example):
    page = (ROOT / "docs" / page).read_text(encoding="utf-8")
    example = ROOT / "examples" / example
    assert f"```python\n{example.read_text(encoding='utf-8')}```" in page


def test_every_example_stands_on_a_page():
    files = ("docs/**/*.md", "README.md")
    found = [page for pattern in files for page in ROOT.glob(pattern)]
    pages = "".join(page.read_text(encoding="utf-8") for page in found)
    examples = ROOT / "examples"
    scripts = [path for path in examples.iterdir() if path.suffix in (".py", ".ipynb")]
    parts = [*examples.glob("arms/*.*"), *examples.glob("extending/*.*")]
    assert len(scripts) > 6
    assert len(parts) > 10
    missing = [f"examples/{path.name}" for path in scripts] + [p.name for p in parts]
    assert [name for name in missing if name not in pages] == []
