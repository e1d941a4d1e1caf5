"""Every public method is documented, by itself or by the method that it overrides.

`help()` and the reference show the inherited docstring. A method without one of its own
therefore overrides a documented method: if that one is renamed, this test fails.
"""

import ast
from collections import defaultdict
from pathlib import Path

PACKAGE = Path(__file__).parents[1] / "src" / "s2c2a"
FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)


def classes_of(package: Path) -> dict[str, list[ast.ClassDef]]:
    """All classes by name; a name may stand for several."""
    classes = defaultdict(list)
    for file in package.rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ClassDef):
                classes[node.name].append(node)
    return classes


def methods_of(cls: ast.ClassDef) -> dict[str, ast.FunctionDef]:
    """Methods by name; a property is documented by its getter, which comes first."""
    methods = {}
    for node in cls.body:
        if isinstance(node, FUNCTIONS):
            methods.setdefault(node.name, node)
    return methods


def base_names(cls: ast.ClassDef) -> list[str]:
    """Names of the bases, without module and type parameters."""
    bases = [
        base.value if isinstance(base, ast.Subscript) else base for base in cls.bases
    ]
    return [base.attr if isinstance(base, ast.Attribute) else base.id for base in bases]


def inherits_docstring(cls: ast.ClassDef, name: str, classes: dict) -> bool:
    """Whether a base in the package documents the method."""
    for base_name in base_names(cls):
        for base in classes.get(base_name, ()):
            method = methods_of(base).get(name)
            if method is not None and ast.get_docstring(method):
                return True
            if inherits_docstring(base, name, classes):
                return True
    return False


def undocumented(package: Path) -> list[str]:
    """Public methods without a docstring, their own or an inherited one."""
    classes = classes_of(package)
    return [
        f"{cls.name}.{name}"
        for same_name in classes.values()
        for cls in same_name
        for name, method in methods_of(cls).items()
        if not name.startswith("_") and not cls.name.startswith("_")
        if not ast.get_docstring(method) and not inherits_docstring(cls, name, classes)
    ]


def test_every_public_method_is_documented_or_overrides_one_that_is():
    assert undocumented(PACKAGE) == []


def test_a_method_that_overrides_nothing_needs_its_own_docstring(tmp_path):
    (tmp_path / "arms.py").write_text(
        "class Base:\n"
        "    def read(self):\n"
        '        """Read."""\n\n\n'
        "class Arm(Base):\n"
        "    def read(self):\n        return 1\n\n"
        "    def reed(self):\n        return 2\n"
    )
    assert undocumented(tmp_path) == ["Arm.reed"]
