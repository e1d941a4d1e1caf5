"""Extension of griffe: the names that a package imports from its modules are public.

The packages have no `__all__`: their `__init__.py` holds nothing but their interface.
"""

from typing import Any

import griffe

PACKAGE = "s2c2a"


class PublicNames(griffe.Extension):
    """Shows the interface of each package on the page that names the package."""

    def on_module_members(self, *, mod: griffe.Module, **_: Any) -> None:
        """Export what a package imports from this project, and what it describes."""
        if mod.is_init_module and mod.exports is None:
            mod.exports = [name for name in mod.members if _is_public(mod, name)]


def _is_public(module: griffe.Module, name: str) -> bool:
    member = module.members[name]
    if name.startswith("_"):
        return False
    if member.is_alias:
        return member.target_path.startswith(f"{PACKAGE}.")
    return not member.is_module and member.has_docstring
