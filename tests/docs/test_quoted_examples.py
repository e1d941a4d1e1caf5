"""Pages quote examples as they are."""

from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_the_page_of_the_control_loop_quotes_the_example():
    page = (ROOT / "docs" / "get-started" / "python.md").read_text(encoding="utf-8")
    example = ROOT / "examples" / "03_a_target_that_moves.py"
    assert f"```python\n{example.read_text(encoding='utf-8')}```" in page


def test_every_example_stands_on_a_page():
    files = ("docs/**/*.md", "README.md")
    pages = "".join(
        page.read_text(encoding="utf-8")
        for pattern in files
        for page in ROOT.glob(pattern)
    )
    examples = ROOT / "examples"
    scripts = [path for path in examples.iterdir() if path.suffix in (".py", ".ipynb")]
    parts = [
        path for name in ("arms", "extending") for path in examples.glob(f"{name}/*.*")
    ]
    assert len(scripts) > 6
    assert len(parts) > 10
    missing = [f"examples/{path.name}" for path in scripts] + [p.name for p in parts]
    assert [name for name in missing if name not in pages] == []
