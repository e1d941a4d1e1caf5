"""Recipes as files (TOML): what a sweep finds, and what a user writes down."""

import os
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import tomli_w
from pydantic import TypeAdapter, ValidationError

from s2c2a.errors import S2C2AError, StrategyError
from s2c2a.files import read_text, save_whole, toml_in
from s2c2a.models import ForwardOptions
from s2c2a.models.registry import MODELS, model_named
from s2c2a.strategies.recipe import RECIPES, Recipe, recipe_named

ENDING = ".toml"
TAGS = {"name", "model"}
"""What says of which form a table is."""


def recipe_from(name_or_file: str | os.PathLike) -> Recipe:
    """A recipe by name, or from a file.

    Raises:
        StrategyError: no such recipe, or the file holds none.
    """
    text = str(name_or_file)
    return load_recipe(text) if text.endswith(ENDING) else recipe_named(text)


def load_recipe(path: str | os.PathLike) -> Recipe:
    """Read a recipe; it goes by the name of its file. With `based_on = "best"` it need only hold what differs.

    A forward model, terms, guides and a solver that it names are imported.

    Raises:
        StrategyError: no such file, not TOML, or no recipe: a key is missing, not known or of another kind.
    """
    if not Path(path).is_file():
        raise StrategyError(f"no recipe at {path}; take {', '.join(RECIPES)}, or a file such as `s2c2a sweep` writes")
    if Path(path).stem in RECIPES:
        raise StrategyError(f"{path} would go by the name of a recipe that is another; give the file a name of its own")
    try:
        written = _in_full(toml_in(read_text(path)), Path(path).parent)
        recipe = recipe_in(written | {"name": Path(path).stem}, model_named)
        recipe.planner.made()  # now, not after the training
        return recipe
    except (ValidationError, S2C2AError) as error:
        raise StrategyError(f"{path} holds no recipe: {error}") from error


def recipe_in(table: dict[str, Any], model: Callable[[str], type[ForwardOptions]]) -> Recipe:
    """The recipe that a table says, whose forward model's options are found by name.

    Raises:
        S2C2AError: it says none.
        ValidationError: the same.
    """
    c2s = table.get("c2s")
    if not isinstance(c2s, dict) or not isinstance(c2s.get("model"), str):
        raise StrategyError(
            "[c2s] names no forward model, as in files of version 0.1; write based_on = 'best' and what differs, "
            f"or a line such as model = 'chain': one of {', '.join(MODELS)}, or your own as module:Name or file.py:Name"
        )
    options = _built(model(c2s["model"]), c2s)
    return _built(Recipe, table | {"c2s": options})


def _built(form: type, table: dict[str, Any]) -> Any:
    return TypeAdapter(form).validate_python(table)


def _in_full(written: dict[str, Any], folder: Path) -> dict[str, Any]:
    """With all of the recipe that it is based on, and files of code beside it found from anywhere."""
    if isinstance(planner := written.get("planner"), dict):
        parts = {key: _beside(planner[key], folder) for key in ("solver", "terms", "guides") if key in planner}
        written = written | {"planner": planner | parts}
    if isinstance(c2s := written.get("c2s"), dict):
        written = written | {"c2s": _beside(c2s, folder, "model")}
    if "based_on" not in written:
        return written
    base = asdict(recipe_named(str(written["based_on"])))
    return _merged(base, {key: value for key, value in written.items() if key != "based_on"})


def _beside(part: Any, folder: Path, key: str = "name") -> Any:
    """A part, or several, as tables, with the name of a file in the folder in full."""
    if isinstance(part, list):
        return [_beside(one, folder) for one in part]
    table = {key: part} if isinstance(part, str) else part
    if not isinstance(table, dict):
        return part
    where, _, what = str(table.get(key)).rpartition(":")
    file = folder / where
    return table | {key: f"{file.resolve()}:{what}"} if file.is_file() else table


def _merged(base: Any, own: Any) -> Any:
    """Tables key by key, unless they are of other forms; lists of parts by their names; else what is own."""
    if _are_parts(base) and _are_parts(own):
        return list(_merged(*({part["name"]: part for part in parts} for parts in (base, own))).values())
    alike = (
        isinstance(base, dict) and isinstance(own, dict) and all(base.get(tag) == own[tag] for tag in TAGS & own.keys())
    )
    if alike:
        return base | {key: _merged(base.get(key), value) for key, value in own.items()}
    return own


def _are_parts(values: Any) -> bool:
    return (
        bool(values)
        and isinstance(values, list | tuple)
        and all(isinstance(part, dict) and "name" in part for part in values)
    )


def save_recipe(recipe: Recipe, path: str | os.PathLike) -> Path:
    """Write a recipe; replaces what is there."""
    written = {name: value for name, value in asdict(recipe).items() if name != "name"}
    return save_whole(tomli_w.dumps(written), path)
