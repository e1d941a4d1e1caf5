"""Tables of the keys of an arm file, as docs/reference/arm-file.md ends with them."""

from collections.abc import Iterable
from itertools import groupby

from s2c2a.arm import Key, file_keys

from tools.markdown import table

COLUMNS = "key", "allowed", "default", "meaning"
# tables that only repeat another one, or that few arms need: `s2c2a arm keys` alone prints them
LEFT_OUT = ("[servos.groups.", "[servos.own_model.registers]")


def arm_keys() -> str:
    """A Markdown table for every table of the file."""
    shown = (key for key in file_keys() if not key.table.startswith(LEFT_OUT))
    tables = groupby(shown, key=lambda key: key.table)
    return "\n".join(_keys_of_table(name, keys) for name, keys in tables)


def _keys_of_table(name: str, keys: Iterable[Key]) -> str:
    title = f"`{name}`" if name else "The arm itself"
    rows = [(f"`{key.name}`", *key[2:]) for key in keys]
    return f"### {title}\n\n{table(COLUMNS, rows)}"
