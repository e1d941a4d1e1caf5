"""Equations of the documentation site: LaTeX as MathML, which browsers draw."""

from latex2mathml.converter import convert


def as_mathml(source: str, *_: object, **__: object) -> str:
    """Convert the source of a `math` block of a page."""
    equation = convert(source, display="block")
    for side in ("left", "right"):  # browsers ignore the attribute of MathML 3
        equation = equation.replace(
            f'columnalign="{side}"', f'style="text-align: {side}"'
        )
    return f'<div class="equation">{equation}</div>'
