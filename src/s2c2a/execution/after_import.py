"""Imports of a module after another package, which `import s2c2a` must not import.

Gymnasium finds environments in its own registry alone, in which they can be entered
only when it is loaded; `import s2c2a` may come before or after that.
"""

import sys
from importlib import import_module


def import_after(package: str, module: str) -> None:
    """Import a module as soon as a package is loaded, or now if it is."""
    if package in sys.modules:
        import_module(module)
        return
    sys.meta_path.insert(0, _Follower(package, module))


class _Follower:
    """Finds the package as all others do, and imports the module after it.

    A finder needs no base class, and that of `importlib.abc` takes longer to import than
    the rest of `s2c2a`.
    """

    def __init__(self, package: str, module: str):
        self._package = package
        self._module = module

    def find_spec(self, name, path=None, target=None):
        if name != self._package:
            return None
        others = [finder for finder in sys.meta_path if finder is not self]
        specs = (finder.find_spec(name, path, target) for finder in others)
        spec = next((found for found in specs if found is not None), None)
        if spec is not None and spec.loader is not None:
            execute = spec.loader.exec_module

            def execute_and_follow(module):
                execute(module)
                import_module(self._module)

            spec.loader.exec_module = execute_and_follow
        return spec
