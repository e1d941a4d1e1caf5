"""Extension of Markdown: values in tables, options and names stay on one line."""

import re

from markdown import Markdown
from markdown.extensions import Extension
from markdown.postprocessors import Postprocessor

VALUE = re.compile(r"(?<=<td>)-?\d[^<]*")
CODE = re.compile(r"(?<=<code>)[^<]+(?=</code>)")
LONGEST = 15  # characters, as `17; 10.7; 18.0`: longer values break, but not at ±
# options, and short names with dashes
WHOLE = re.compile(rf"(?<!\S)(?:-\S+|(?=\S{{,{LONGEST}}}(?!\S))\w+-\S+)")


class Unbroken(Postprocessor):
    """Replaces spaces of values, and marks words at whose dashes browsers break lines."""

    def run(self, text: str) -> str:
        """Change the cells and the inline code of a page, which is HTML."""
        return CODE.sub(_with_whole_words, VALUE.sub(_unbroken, text))


def _unbroken(value: re.Match[str]) -> str:
    inside = " " if len(value[0]) <= LONGEST else " (?=±)|(?<=±) "
    return re.sub(inside, "&nbsp;", value[0])


def _with_whole_words(code: re.Match[str]) -> str:
    return WHOLE.sub(r'<span class="whole">\g<0></span>', code[0])


class UnbrokenExtension(Extension):
    """Changes a page after everything else is HTML."""

    def extendMarkdown(self, md: Markdown) -> None:  # noqa: N802, of the interface
        """Register the processor behind all others."""
        md.postprocessors.register(Unbroken(md), "unbroken", -1)


def makeExtension(**options: object) -> UnbrokenExtension:  # noqa: N802
    """Make the extension, as Markdown asks for it by the name of this module."""
    return UnbrokenExtension(**options)
