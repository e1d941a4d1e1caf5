import re
from pathlib import Path

from s2c2a.viz import colors as palette
from s2c2a.viz.colors import colors_by_label, module_colors


def test_module_colors_run_from_blue_over_green_to_red():
    assert module_colors(3) == ["#2f6fdb", "#34a853", "#e0463a"]
    assert module_colors(1) == ["#2f6fdb"]
    for count in (2, 5, 20):
        colors = module_colors(count)
        assert len(set(colors)) == count
        assert (colors[0], colors[-1]) == ("#2f6fdb", "#e0463a")


def test_a_strategy_keeps_its_color_beside_any_other():
    assert colors_by_label(["pcc", "s2c2a"]) == colors_by_label(["s2c2a", "pcc"])
    assert colors_by_label(["mine", "pcc"])["pcc"] == colors_by_label(["pcc"])["pcc"]


def test_unknown_strategies_get_different_colors():
    colors = colors_by_label(["mine", "s2c2a", "yours", "pcc"])
    assert len(set(colors.values())) == 4


LITERAL = re.compile(r"#[0-9a-fA-F]{6}\b|(?i:color)\w*\s*=\s*\(\s*\d")
"""A color that is written where it is used."""


def test_only_the_palette_writes_colors():
    package = Path(palette.__file__).parents[1]
    found = [
        f"{file.relative_to(package)}: {line.strip()}"
        for file in sorted(package.rglob("*.py"))
        if file != Path(palette.__file__)
        for line in file.read_text("utf-8").splitlines()
        if LITERAL.search(line)
    ]
    assert not found


def test_a_literal_color_is_found():
    assert LITERAL.search('axes.plot(x, y, color="#b9c1cb")')
    assert LITERAL.search("ARM_COLOR = (0.25, 0.45, 0.75, 1.0)")
    assert LITERAL.search("ground_color=(190, 198, 210)")
