"""A frozen value is changed by `replace`, which keeps the fields that it does not name."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FILES = [*(ROOT / "src").rglob("*.py"), *(ROOT / "experiments").rglob("*.py")]


@pytest.fixture(scope="module")
def trees():
    """Syntax trees of all files; not kept for other tests, being a million objects."""
    return {path: ast.parse(path.read_text("utf-8")) for path in FILES}


@pytest.fixture(scope="module")
def classes(trees):
    """Fields of all frozen classes."""
    return frozen_fields(trees.values())


def frozen_fields(trees):
    """Names of the fields of all frozen dataclasses and named tuples, by class."""
    classes = {}
    for tree in trees:
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef) and is_frozen(node):
                classes[node.name] = [
                    part.target.id
                    for part in node.body
                    if isinstance(part, ast.AnnAssign)
                    and "ClassVar" not in ast.dump(part)
                ]
    return classes


def is_frozen(node):
    signs = [*map(ast.unparse, node.decorator_list), *map(ast.unparse, node.bases)]
    return any("frozen=True" in sign or sign == "NamedTuple" for sign in signs)


def partial_copies(tree, classes):
    """Calls that take fields of one value over into another, and leave others out."""
    known = annotated_names(tree)
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call):
            continue
        name_of_class = ast.unparse(node.func).rpartition(".")[2]
        fields = classes.get(name_of_class)
        if not fields or any(isinstance(part, ast.Starred) for part in node.args):
            continue
        given = dict(zip(fields, node.args, strict=False))
        given |= {part.arg: part.value for part in node.keywords if part.arg}
        sources = {
            ast.unparse(value.value)
            for name, value in given.items()
            if isinstance(value, ast.Attribute)
            and value.attr == name
            and isinstance(value.value, ast.Name)
            and is_of(value.value.id, name_of_class, known)
        }
        if sources and len(given) < len(fields):
            yield f"{node.lineno}: {ast.unparse(node)}"


def annotated_names(tree):
    """Pairs of a parameter and the class that it is annotated with."""
    return {
        (node.arg, ast.unparse(node.annotation).strip("'\""))
        for node in ast.walk(tree)
        if isinstance(node, ast.arg) and node.annotation
    }


def is_of(name, name_of_class, known):
    """Whether a variable holds a value of a class, by its annotation or its name."""
    return (name, name_of_class) in known or name == name_of_class.lower()


def test_no_value_is_rebuilt_from_a_part_of_another(trees, classes):
    found = [
        f"{path.relative_to(ROOT)}:{call}"
        for path, tree in trees.items()
        for call in partial_copies(tree, classes)
    ]
    assert not found, "\n".join(found)


@pytest.mark.parametrize(
    ("code", "is_partial"),
    [
        ("Reading(reading.time, sensors)", True),
        ("spaces.Reading(time=reading.time, sensors={})", True),
        ("replace(reading, sensors=sensors)", False),
        ("Reading(self.data.time, values)", False),
    ],
)
def test_a_partial_copy_is_found_and_a_whole_one_is_not(code, is_partial, classes):
    assert bool(list(partial_copies(ast.parse(code), classes))) == is_partial
