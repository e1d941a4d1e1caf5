"""Sizes of functions and density of lines: `python tests/test_house.py` prints them."""

import ast
import io
import re
import sys
import tokenize
from collections import defaultdict
from functools import cache
from itertools import zip_longest
from pathlib import Path
from statistics import median, quantiles

ROOT = Path(__file__).parents[1]
FILES = sorted([*(ROOT / "src").rglob("*.py"), *(ROOT / "experiments").rglob("*.py")])
WINGS = ("lab", "logs", "live", "integrations")
MAX_CORE = 23466
"""Code lines of the core; it only falls, and the aim is 20,000."""
MAX_NUMBERS = 507
"""Numbers of the core that decide, ranges of keys in files among them; the aim is 400."""
WITHOUT_SOURCES = {
    "models/prior.py",
}
"""Files of the core with numbers that do not say where they come from; no new ones."""
DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)
LAYOUT = {
    tokenize.COMMENT,
    tokenize.NL,
    tokenize.NEWLINE,
    tokenize.INDENT,
    tokenize.DEDENT,
    tokenize.ENDMARKER,
}


@cache
def code_lines(text: str) -> set[int]:
    """Numbers of the lines that hold code: no blanks, comments or docstrings."""
    lines = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in LAYOUT:
            lines |= set(range(token.start[0], token.end[0] + 1))
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, DOCUMENTED) and ast.get_docstring(node) is not None:
            docstring = node.body[0]
            lines -= set(range(docstring.lineno, docstring.end_lineno + 1))
    return lines


def syntax_nodes(text: str) -> int:
    """Number of syntax nodes without docstrings."""
    tree = ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(node, DOCUMENTED) and ast.get_docstring(node) is not None:
            del node.body[0]
    return sum(1 for _ in ast.walk(tree))


def function_sizes() -> list[int]:
    """Code lines of every function."""
    sizes = []
    for file in FILES:
        text = file.read_text(encoding="utf-8")
        lines = code_lines(text)
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, FUNCTIONS):
                sizes.append(len(lines & set(range(node.lineno, node.end_lineno + 1))))
    return sizes


@cache
def density() -> tuple[int, int]:
    """Syntax nodes and code lines of the package."""
    texts = [file.read_text(encoding="utf-8") for file in FILES]
    nodes = sum(syntax_nodes(text) for text in texts)
    return nodes, sum(len(code_lines(text)) for text in texts)


def test_a_line_does_one_thing():
    nodes, lines = density()
    assert nodes / lines <= 9.0


def test_the_core_has_at_most_its_lines():
    core = [file for file in FILES if is_core(file)]
    assert sum(len(code_lines(file.read_text("utf-8"))) for file in core) <= MAX_CORE


def deciding_numbers(tree: ast.AST) -> int:
    """Number of module constants, defaults of options, and literals in comparisons.

    Zero, one and two decide nothing by their size. Tables do not count.
    """
    values = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef):
            assigned = [part for part in node.body if isinstance(part, ast.AnnAssign)]
            if isinstance(node, ast.Module):
                assigned += [part for part in node.body if isinstance(part, ast.Assign)]
            values += [part.value for part in assigned if part.value is not None]
    numbers = sum(is_number(value) for value in values)
    compared = [
        value
        for node in ast.walk(tree)
        if isinstance(node, ast.Compare)
        for value in (node.left, *node.comparators)
    ]
    return numbers + sum(
        is_number(value) and value.value not in (0, 1, 2)
        for value in compared
        if isinstance(value, ast.Constant)
    )


def is_number(value: ast.expr) -> bool:
    """Whether an expression is a number, or computed from some, such as np.deg2rad(3)."""
    if isinstance(value, ast.Dict | ast.List | ast.Set | ast.Tuple | ast.Subscript):
        return False
    literals = [part for part in ast.walk(value) if isinstance(part, ast.Constant)]
    return any(type(part.value) in (int, float) for part in literals)


def test_few_numbers_decide_in_the_core():
    trees = [ast.parse(file.read_text("utf-8")) for file in FILES if is_core(file)]
    assert sum(map(deciding_numbers, trees)) <= MAX_NUMBERS


def has_source(statement: ast.stmt, following: ast.stmt | None, text: str) -> bool:
    """Whether a docstring or comment says where a constant comes from.

    A comment is at the constant, or above it and others without a blank line between.
    """
    match following:
        case ast.Expr(ast.Constant(str())):
            return True
    lines = text.splitlines()
    own = "\n".join(lines[statement.lineno - 1 : statement.end_lineno])
    if "#" in own:
        return True
    for line in reversed(lines[: statement.lineno - 1]):
        if line.startswith("#"):
            return True
        if not re.match(r"[A-Z_]+\b.* = ", line):
            return False
    return False


def numbers_without_source(text: str) -> list[str]:
    """Module constants that are numbers, and do not say where they come from."""
    body = ast.parse(text).body
    return [
        ast.unparse(statement)
        for statement, following in zip_longest(body, body[1:])
        if isinstance(statement, ast.Assign | ast.AnnAssign)
        if statement.value is not None and is_number(statement.value)
        if not has_source(statement, following, text)
    ]


def test_a_number_without_a_source_is_found():
    assert numbers_without_source("A = 1.0\nB = 2 * A  # twice\n") == ["A = 1.0"]
    assert (
        numbers_without_source('# of both\nA = 1\nB = 2\n\nC = 3\n"""Why."""\n') == []
    )
    assert numbers_without_source("# of others\n\nA = 1\n") == ["A = 1"]


def test_a_number_of_a_module_says_where_it_comes_from():
    package = ROOT / "src" / "s2c2a"
    found = {
        str(file.relative_to(package)): numbers_without_source(file.read_text("utf-8"))
        for file in FILES
        if is_core(file)
    }
    assert not {
        name: numbers
        for name, numbers in found.items()
        if numbers and name not in WITHOUT_SOURCES
    }


def is_core(file: Path) -> bool:
    """Whether a file is in the package, and in none of its wings."""
    package = ROOT / "src" / "s2c2a"
    if not file.is_relative_to(package):
        return False
    return file.relative_to(package).parts[0] not in WINGS


def test_one_class_name_means_one_thing():
    """The names of `paper.py` are the paper's, and stand for the same in the recipe."""
    places = defaultdict(list)
    for file in FILES:
        if file.name != "paper.py":
            for node in ast.parse(file.read_text(encoding="utf-8")).body:
                if isinstance(node, ast.ClassDef):
                    places[node.name].append(str(file.relative_to(ROOT)))
    twice = {name: files for name, files in places.items() if len(files) > 1}
    assert not twice


if __name__ == "__main__":
    sizes = function_sizes()
    nodes, lines = density()
    tenth = quantiles(sizes, n=10)[-1]
    sys.stdout.write(
        f"{nodes} nodes in {lines} code lines of {len(FILES)} files: "
        f"{nodes / lines:.2f} a line\n{len(sizes)} functions: median {median(sizes)}, "
        f"90th percentile {tenth}, largest {max(sizes)}\n"
    )
