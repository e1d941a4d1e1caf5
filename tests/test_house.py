"""How large the house is, and that its rooms stay small: `python tests/test_house.py` prints the figures."""

import ast
import io
import tokenize
from collections import Counter
from pathlib import Path
from statistics import median, quantiles

HOUSE = Path(__file__).parents[1] / "src" / "s2c2a"
FILES = sorted(HOUSE.rglob("*.py"))
WORDS = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
SPACE = {
    *(
        tokenize.COMMENT,
        tokenize.NL,
        tokenize.NEWLINE,
        tokenize.INDENT,
        tokenize.DEDENT,
        tokenize.ENDMARKER,
    ),
}


def code_lines(text: str) -> set[int]:
    """Numbers of the lines that hold code: no blanks, comments, docstrings."""
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    code = {
        line
        for one in tokens
        if one.type not in SPACE
        for line in range(one.start[0], one.end[0] + 1)
    }
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, WORDS) and ast.get_docstring(node) is not None:
            code -= set(range(node.body[0].lineno, node.body[0].end_lineno + 1))
    return code


def sizes() -> tuple[Counter, list[int]]:
    """Code lines of every room, and of every function, its heading counted."""
    rooms, functions = Counter(), []
    for file in FILES:
        text, room = (
            file.read_text(encoding="utf-8"),
            file.relative_to(HOUSE).parts[:-1],
        )
        lines = code_lines(text)
        rooms[room[0] if room else "."] += len(lines)
        functions += [
            len(lines & set(range(node.lineno, node.end_lineno + 1)))
            for node in ast.walk(ast.parse(text))
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        ]
    return rooms, functions


def test_functions_and_files_are_small():
    functions = sizes()[1]
    assert median(functions) <= 5
    assert quantiles(functions, n=10)[-1] <= 20
    assert (
        max(len(file.read_text(encoding="utf-8").splitlines()) for file in FILES) <= 300
    )


def test_what_drives_an_arm_is_more_than_the_page_and_more_than_the_pictures():
    rooms = sizes()[0]
    sensing = len(code_lines((HOUSE / "sensing.py").read_text(encoding="utf-8")))
    drives = sensing + sum(
        rooms[name]
        for name in ("models", "planning", "control", "kinematics", "runtime")
    )
    assert drives > max(rooms["live"], rooms["viz"])


if __name__ == "__main__":
    rooms, functions = sizes()
    tenth = quantiles(functions, n=10)[-1]
    print(
        f"{rooms.total()} code lines in {len(FILES)} files: {dict(rooms.most_common())}"
    )
    print(
        f"{len(functions)} functions: median {median(functions)}, 90th percentile {tenth}, most {max(functions)}"
    )
