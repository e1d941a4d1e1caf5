"""Equations of the documentation site: LaTeX as MathML, which browsers draw."""

from latex2mathml.converter import convert


def as_mathml(source: str, *_: object, **__: object) -> str:
    """Convert the source of a `math` block of a page."""
    return f'<div class="equation">{convert(source, display="block")}</div>'
