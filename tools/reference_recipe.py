"""Page of all keys of a recipe file, from the dataclasses that validate them."""

from collections.abc import Iterator, Mapping
from dataclasses import MISSING, asdict, fields, is_dataclass
from types import NoneType
from typing import Annotated, Any, Literal, get_args, get_origin, get_type_hints

from griffe import Docstring, DocstringSectionKind

from s2c2a.control.options import CONTROLLERS
from s2c2a.data.babbling import BABBLING
from s2c2a.estimation import ESTIMATORS
from s2c2a.models.registry import MODELS
from s2c2a.planning import PlannerOptions
from s2c2a.planning.guides import GUIDES
from s2c2a.planning.planner import SOLVERS
from s2c2a.planning.terms import TERMS
from s2c2a.strategies import RECIPES, Recipe
from s2c2a.training.fit import FitOptions

from tools.markdown import cell, first_paragraph, header, linked, table

FOLDER = "reference"
SHOWN = ("best", "paper")
OPENING = """# Recipe files

A recipe holds every choice about data, networks, state estimation, planning and
control. `--recipe` takes a name or a file. A file names the recipe that it starts from
and holds only what differs:

```toml
based_on = "best"
episodes = 36

[c2a]
hidden = 64
```

A file without `based_on` needs all keys that have no default.
[The recipe best](../concepts/recipe.md) explains and measures the choices, and
[Your robot and your own parts](../guides/extending.md) replaces a part by your code.
"""
NUMBERS = """Solver, terms, guides and state estimator are components. Their numbers are
at least 0 and at most 1 000 000, and `iterations` at most 10 000. In place of a table, a
component may be your own: `name = "file.py:Name"`, with its arguments in `parameters`.
"""
WORDS: Mapping[Any, str] = {
    int: "whole number",
    float: "number",
    bool: "true or false",
    str: "text",
}
PLACES = {
    "c2s": "table `[c2s]`",
    "c2a": "table `[c2a]`",
    "c2s_fit": "table `[c2s_fit]`",
    "c2a_fit": "table `[c2a_fit]`",
    "estimator": "table `[estimator]`",
    "planner": "table `[planner]`",
    "solver": "table `[planner.solver]`",
    "terms": "tables `[[planner.terms]]`",
    "guides": "tables `[[planner.guides]]`",
}
"""Keys that are tables: where they stand."""
COMPONENTS = (
    ("Solver: `[planner.solver]`", SOLVERS),
    ("Terms: `[[planner.terms]]`", TERMS),
    ("Guides: `[[planner.guides]]`", GUIDES),
)


def recipe_page() -> str:
    """The page: one section for each table of a recipe file."""
    recipes = {name: RECIPES[name] for name in SHOWN}
    parts = [header("the dataclasses of a recipe"), OPENING]
    parts += ["## The recipe itself\n", keys_table(Recipe, recipes), _other_recipes()]
    parts += _options("Forward model: `[c2s]`", "model", MODELS.known, "c2s")
    parts += _options("Controller: `[c2a]`", "model", CONTROLLERS.known, "c2a")
    parts += _training()
    parts += _options(
        "State estimator: `[estimator]`", "name", ESTIMATORS.known, "estimator"
    )
    planners = {name: recipe.planner for name, recipe in recipes.items()}
    parts += ["## Planner: `[planner]`\n", keys_table(PlannerOptions, planners)]
    parts.append(NUMBERS)
    for heading, registry in COMPONENTS:
        parts += [f"### {heading}\n", *_components(registry.known)]
    return "\n".join(parts)


def _other_recipes() -> str:
    """The recipes that are not shown, as differences from `best`."""
    rows = []
    base = asdict(RECIPES["best"])
    for name in RECIPES.keys() - set(SHOWN):
        recipe = asdict(RECIPES[name])
        changes = {key: recipe[key] for key in recipe if recipe[key] != base[key]}
        del changes["name"]
        text = ", ".join(f"{key} = {_value(value)}" for key, value in changes.items())
        rows.append((f"`{name}`", f"`best` with `{text}`"))
    return table(("recipe", "content"), sorted(rows))


def _options(
    heading: str, tag: str, known: Mapping[str, type], key: str
) -> Iterator[str]:
    """Sections of all classes of one kind that a recipe can name."""
    yield f"## {heading}\n"
    for name, kind in known.items():
        values = {
            recipe: getattr(RECIPES[recipe], key)
            for recipe in SHOWN
            if type(getattr(RECIPES[recipe], key)) is kind
        }
        yield from _class_section(f'{tag} = "{name}"', kind, values, level=3)


def _training() -> Iterator[str]:
    values = {}
    for name in SHOWN:
        recipe = RECIPES[name]
        if recipe.c2s_fit != recipe.c2a_fit:
            raise SystemExit("c2s_fit and c2a_fit differ: show both")
        values[name] = recipe.c2s_fit
    yield "## Training: `[c2s_fit]` and `[c2a_fit]`\n"
    yield "Training of the forward model and of the controller, with the same keys.\n"
    yield keys_table(FitOptions, values)


def _components(known: Mapping[str, type]) -> Iterator[str]:
    for name, kind in known.items():
        values = {}
        for recipe in SHOWN:
            for component in _components_of(RECIPES[recipe].planner):
                if type(component) is kind:
                    values[recipe] = component
        yield from _class_section(f'name = "{name}"', kind, values, level=4)


def _components_of(planner: PlannerOptions) -> Iterator[Any]:
    yield planner.solver
    yield from planner.terms
    yield from planner.guides


def _class_section(
    heading: str, kind: type, values: Mapping[str, Any], level: int
) -> Iterator[str]:
    used = " and ".join(f"`{recipe}`" for recipe in values)
    yield f"{'#' * level} `{heading}`\n"
    text = linked(first_paragraph(kind.__doc__), FOLDER)
    yield f"{text} {f'Used by {used}.' if used else 'Used by neither `best` nor `paper`.'}\n"
    if any(_is_key(item.name) for item in fields(kind)):
        yield keys_table(kind, values)
    else:
        yield "It has no keys.\n"


def keys_table(kind: type, values: Mapping[str, Any]) -> str:
    """Table of the keys of a dataclass.

    Args:
        kind: the dataclass.
        values: instances whose values are shown, by recipe; empty for the defaults.
    """
    hints = get_type_hints(kind, include_extras=True)
    meanings = field_meanings(kind)
    rows = []
    for item in fields(kind):
        if not _is_key(item.name):
            continue
        if item.name not in meanings:
            raise SystemExit(f"{kind.__name__} documents no '{item.name}'")
        shown = [_cell_of(item.name, value) for value in values.values()]
        rows.append(
            (
                f"`{item.name}`",
                _type(item.name, hints[item.name]),
                *(shown or [_default(item)]),
                linked(cell(meanings[item.name]), FOLDER),
            )
        )
    recipes = [f"`{name}`" for name in values] or ["default"]
    return table(("key", "type", *recipes, "meaning"), rows)


def _is_key(name: str) -> bool:
    """Whether files hold the field, besides the key that names the class."""
    return name not in ("name", "model", "own_code")


def field_meanings(kind: type) -> dict[str, str]:
    """Descriptions of the attributes, also of inherited ones, from docstrings."""
    meanings: dict[str, str] = {}
    for base in reversed(kind.__mro__):
        if not is_dataclass(base):
            continue
        for section in Docstring(base.__doc__ or "", parser="google").parse():
            if section.kind is DocstringSectionKind.attributes:
                for attribute in section.value:
                    meanings[attribute.name] = attribute.description
    return meanings


def _type(name: str, hint: Any) -> str:
    if name in PLACES:
        return PLACES[name]
    if name == "babbling":
        return ", ".join(f"`{_value(choice)}`" for choice in BABBLING)
    if name == "axis_weights":
        return "pairs of text and number"
    origin = get_origin(hint)
    if origin is Annotated:
        return _type(name, get_args(hint)[0])
    if origin is Literal:
        return ", ".join(f"`{_value(choice)}`" for choice in get_args(hint))
    if origin is tuple:
        kinds = [kind for kind in get_args(hint) if kind is not Ellipsis]
        count = f"{len(kinds)} " if Ellipsis not in get_args(hint) else ""
        return f"{count}{WORDS[kinds[0]]}s"
    if NoneType in get_args(hint):
        return _type(name, get_args(hint)[0])
    return WORDS[hint]


def _cell_of(name: str, instance: Any) -> str:
    """Value of a field; of a table, the name of its class."""
    value = getattr(instance, name)
    if name in ("c2s_fit", "c2a_fit", "planner"):
        return "see below"
    if is_dataclass(value):
        return f"`{getattr(value, 'model', '') or value.name}`"
    if isinstance(value, tuple) and value and is_dataclass(value[0]):
        return ", ".join(f"`{entry.name}`" for entry in value)
    return f"`{_value(value)}`"


def _default(item: Any) -> str:
    if item.default is MISSING:
        return "required"
    return f"`{_value(item.default)}`"


def _value(value: Any) -> str:
    """Value as TOML."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, tuple):
        return f"[{', '.join(map(_value, value))}]"
    return f"{value:g}"
