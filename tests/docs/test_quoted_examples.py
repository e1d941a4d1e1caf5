"""Pages quote examples as they are."""

from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_the_page_of_own_parts_quotes_the_robot_of_the_examples():
    page = (ROOT / "docs" / "guides" / "extending.md").read_text(encoding="utf-8")
    robot = ROOT / "examples" / "extending" / "own_robot.py"
    assert f"```python\n{robot.read_text(encoding='utf-8')}```" in page
