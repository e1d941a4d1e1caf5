"""Recipes as files (TOML): what a sweep finds, and what a user writes down."""

import os
import tomllib
from dataclasses import asdict
from pathlib import Path

import tomli_w
from pydantic import TypeAdapter, ValidationError

from s2c2a.errors import S2C2AError, StrategyError
from s2c2a.files import save_whole
from s2c2a.strategies.checkpoint import all_read
from s2c2a.strategies.recipe import RECIPES, Recipe, recipe_named

ENDING = ".toml"


def recipe_from(name_or_file: str | os.PathLike) -> Recipe:
    """A recipe by name, or from a file.

    Raises:
        StrategyError: no such recipe, or the file holds none.
    """
    text = str(name_or_file)
    return load_recipe(text) if text.endswith(ENDING) else recipe_named(text)


def load_recipe(path: str | os.PathLike) -> Recipe:
    """Read a recipe; it goes by the name of its file.

    Raises:
        StrategyError: no such file, not TOML, or no recipe: a key is missing, not known or of another kind.
    """
    if not Path(path).is_file():
        raise StrategyError(f"no recipe at {path}; take {', '.join(RECIPES)}, or a file such as `s2c2a sweep` writes")
    if Path(path).stem in RECIPES:
        raise StrategyError(f"{path} would go by the name of a recipe that is another; give the file a name of its own")
    adapter = TypeAdapter(Recipe)
    try:
        written = tomllib.loads(Path(path).read_text(encoding="utf-8"))
        recipe = adapter.validate_python(written | {"name": Path(path).stem})
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, ValidationError, S2C2AError) as error:
        raise StrategyError(f"{path} holds no recipe: {error}") from error
    if not all_read(written, adapter.dump_python(recipe)):
        raise StrategyError(f"{path} holds no recipe: some of its keys belong to none, or to parts of different forms")
    return recipe


def save_recipe(recipe: Recipe, path: str | os.PathLike) -> Path:
    """Write a recipe; replaces what is there."""
    written = {name: value for name, value in asdict(recipe).items() if name != "name"}
    return save_whole(tomli_w.dumps(written), path)
