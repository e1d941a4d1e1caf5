"""Recipes: every choice about data, networks, estimation, planning and control.

A recipe has a name, or stands in a TOML file of the user's.
"""

import os
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Annotated, Any, ClassVar

import tomli_w
from jaxtyping import PRNGKeyArray
from pydantic import BeforeValidator, SkipValidation, TypeAdapter, ValidationError

from s2c2a.arm import ArmSpec
from s2c2a.control.options import CONTROLLERS, C2AOptions, ControllerOptions
from s2c2a.data import CollectOptions
from s2c2a.data.babbling import BABBLING, SPEEDS
from s2c2a.errors import MAX_NAME_LENGTH, S2C2AError, StrategyError, no_such
from s2c2a.estimation import (
    ESTIMATORS,
    ConfigurationMap,
    EncoderOnly,
    EstimatorOptions,
    KalmanFilter,
    UnitLengthMap,
    configuration_map_for,
)
from s2c2a.files.text import LARGEST, MAX_COUNT, parse_toml, read_text, write_atomically
from s2c2a.files.validation import explained, unknown_key
from s2c2a.models import C2SOptions, ForwardOptions, LocalOptions
from s2c2a.models.registry import MODELS
from s2c2a.paper import C2S_SIZE, HISTORY_NOISE
from s2c2a.planning import BEST, PAPER, PlannerOptions
from s2c2a.planning.guides import GUIDES
from s2c2a.planning.planner import SOLVERS
from s2c2a.planning.terms import TERMS
from s2c2a.plugins.components import CustomComponent, Options, Ranges, Registry
from s2c2a.plugins.discovery import trust_code_in
from s2c2a.training.fit import FitOptions

ENDING = ".toml"
HEADING = "{faults} in the recipe"
HINT = " (with a line such as based_on = 'best', a file need not be complete)"
TAGS = {"name", "model"}
"""Keys that say of which class a table is."""

NESTED: dict[str, Registry[Any]] = {
    "planner.solver": SOLVERS,
    "planner.terms": TERMS,
    "planner.guides": GUIDES,
}
"""Components inside the table of the planner, by their place in a recipe."""

AnyEstimator = Annotated[
    EstimatorOptions | CustomComponent, SkipValidation, BeforeValidator(ESTIMATORS.read)
]


@dataclass(frozen=True)
class Recipe(Options):
    """How a strategy is trained, and how it estimates, plans and acts.

    Attributes:
        name: by which users choose it.
        c2s: the forward model.
        c2a: the learned controller.
        c2s_fit: training of the forward model.
        c2a_fit: training of the controller.
        history_noise: standard deviation of noise on past actions while the controller
            is trained, normalized.
        estimator: state estimator, with its options.
        planner: options of the planner.
        babbling: how the data explore the arm (`data.babbling.BABBLING`).
        speeds: slowest and fastest motion of the data, in parts of the full bend a step.
        episodes: number of episodes of the data.
        integral_gain: part of the controller's lasting error that is integrated in every
            step; 0 for none.
        axis_weights: beginnings of task names, each with the factor of mu_o, the weight
            of axes, for these tasks.
        unit_length: whether sensed configurations are scaled to unit length, whatever
            mixes them.
        encoders_alone: whether forward model and controller see the encoders alone;
            otherwise they see what the arm file names as `sensing`.
    """

    name: str
    c2s: ForwardOptions
    c2a: ControllerOptions
    c2s_fit: FitOptions = field(default_factory=FitOptions)
    c2a_fit: FitOptions = field(default_factory=FitOptions)
    history_noise: float = HISTORY_NOISE
    estimator: AnyEstimator = field(default_factory=EncoderOnly)
    planner: PlannerOptions = PAPER
    babbling: str = "staged"
    speeds: tuple[float, float] = SPEEDS
    episodes: int = CollectOptions.episodes
    integral_gain: float = 0.0
    axis_weights: tuple[tuple[str, float], ...] = ()
    unit_length: bool = False
    encoders_alone: bool = False

    limits: ClassVar[Ranges] = {
        "history_noise": (0, 1000),
        "speeds": (0, 10),
        "episodes": (1, MAX_COUNT),
        "integral_gain": (0, 10),
    }

    def __post_init__(self):
        """Refuse impossible numbers; name the classes of the networks."""
        super().__post_init__()
        if self.babbling not in BABBLING:
            raise StrategyError(
                f"babbling = '{self.babbling}' was given; choose one of "
                f"{', '.join(BABBLING)}"
            )
        if not all(0 <= weight <= LARGEST for _, weight in self.axis_weights):
            raise StrategyError(
                f"axis_weights = {self.axis_weights} was given; give weights of 0 to {LARGEST:g}"
            )
        if not self.c2s.model:
            object.__setattr__(self, "c2s", _named(self.c2s, MODELS))
        if not self.c2a.model:
            object.__setattr__(self, "c2a", _named(self.c2a, CONTROLLERS))

    @property
    def estimator_options(self) -> EstimatorOptions:
        """The estimator's options; a user's own class is imported.

        Raises:
            S2C2AError: it is not found, or may not be imported.
        """
        return ESTIMATORS.build(self.estimator)

    @property
    def by_class(self) -> "Recipe":
        """The same, naming the user's own classes by module, as weight files do.

        A recipe file names them by their files, wherever these are.
        """
        return replace(
            self, c2s=_named(self.c2s, MODELS), c2a=_named(self.c2a, CONTROLLERS)
        )

    @property
    def training(self) -> dict[str, Any]:
        """All options that training depends on, with the names of all classes."""
        options = asdict(self)
        for name in ("name", "episodes", "planner", "integral_gain", "axis_weights"):
            del options[name]
        is_custom = isinstance(self.estimator, CustomComponent)
        # parameters of a custom estimator may matter to its training
        options["estimator"] = (
            asdict(self.estimator) if is_custom else self.estimator.name
        )
        return options

    def collect_options(self, seed: int = 0) -> CollectOptions:
        """How its data are collected.

        Raises:
            RecordingError: the recipe's speeds are impossible.
        """
        return CollectOptions(
            self.babbling, self.episodes, seed=seed, speeds=self.speeds
        )

    def untrained(self, arm: ArmSpec, key: PRNGKeyArray) -> dict[str, Any]:
        """All networks before training, by name."""
        seen_arm = self.seen_arm(arm)
        return {
            "C2S": self.c2s.untrained(seen_arm, key),
            "C2A": self.c2a.untrained(seen_arm, key),
            **self.estimator_options.untrained(arm, key),
        }

    def axis_weight(self, task: str) -> float:
        """The factor of mu_o for a task."""
        for prefix, weight in self.axis_weights:
            if task.startswith(prefix):
                return weight
        return 1.0

    def seen_arm(self, arm: ArmSpec) -> ArmSpec:
        """The arm as its networks see it, in training and planning.

        With `encoders_alone` it has encoders and the sensors that are learned.
        """
        if not self.encoders_alone:
            return arm
        without_currents = {"current_noise": None, "current_friction": 0.0}
        changes = {
            "sensing": "encoders" if arm.sensing == "true" else arm.sensing,
            "sensors": arm.sensors.learned,
            "motor": arm.motor.model_copy(update=without_currents),
        }
        return arm.model_copy(update=changes)

    def configuration_map(self, arm: ArmSpec) -> ConfigurationMap:
        """The map from the arm's readings to the configurations of this recipe."""
        configuration_map = configuration_map_for(self.seen_arm(arm))
        if self.unit_length:
            return UnitLengthMap(configuration_map)
        return configuration_map


def _named(options: Any, registry: Registry) -> Any:
    """The options with the name of their class in files."""
    return replace(options, model=registry.name_of(type(options)))


# compared with the paper's training in docs/concepts/recipe.md
_DECAYING = FitOptions(
    learning_rate=2e-3, max_epochs=60, patience=60, epochs_per_call=10, decay=True
)

# docs/concepts/recipe.md measures what each difference to the paper brings
_BEST = Recipe(
    "best",
    c2s=LocalOptions(),
    c2a=C2AOptions(),
    c2s_fit=_DECAYING,
    c2a_fit=_DECAYING,
    estimator=KalmanFilter(),
    planner=BEST,
    babbling="coverage",
    speeds=(0.03, 0.1),
    integral_gain=0.2,
    axis_weights=(("hold-", 3.0),),
    unit_length=True,
    encoders_alone=True,
)
# an hour of data, for arms with slack cables
_BEST_LONG = replace(_BEST, name="best-long", episodes=72)
_PAPER = Recipe(
    "paper",
    c2s=C2SOptions(layers=C2S_SIZE["layers"], hidden=C2S_SIZE["hidden"]),
    c2a=C2AOptions(),
)
RECIPES = {recipe.name: recipe for recipe in (_BEST, _BEST_LONG, _PAPER)}
"""Recipes of the package, by name; docs/concepts/recipe.md measures their parts."""


def recipe_named(name: str) -> Recipe:
    """Look up a recipe of the package.

    Raises:
        StrategyError: no such recipe.
    """
    if name not in RECIPES:
        raise StrategyError(no_such("recipe", name, RECIPES))
    return RECIPES[name]


def recipe_from(name_or_file: Recipe | str | os.PathLike) -> Recipe:
    """A recipe by name, or from a file; a recipe itself stays.

    Raises:
        StrategyError: no such recipe, or the file holds none.
    """
    if isinstance(name_or_file, Recipe):
        return name_or_file
    text = str(name_or_file)
    return load_recipe(text) if text.endswith(ENDING) else recipe_named(text)


def load_recipe(path: str | os.PathLike) -> Recipe:
    """Read a recipe from a file, and name it after the file.

    With `based_on = "best"` the file holds only what differs. Classes of the user's own
    that it names are imported.

    Raises:
        StrategyError: no such file, not TOML, or no recipe: a key is missing, unknown or
            of the wrong kind.
    """
    if not Path(path).is_file():
        raise StrategyError(
            f"no recipe at {path}; choose {', '.join(RECIPES)}, or a file of yours"
        )
    if Path(path).stem in RECIPES:
        raise StrategyError(
            f"{path} has the name of a recipe of the package; rename the file"
        )
    try:
        written = parse_toml(read_text(path))
        table = _complete(written, Path(path).parent) | {"name": Path(path).stem}
        trust_code_in(table)
        recipe = recipe_in(table, Registry.named)
        # import now what the recipe names, not after the training
        recipe.planner.build()
        _ = recipe.estimator_options
        return recipe
    except ValidationError as error:
        hint = "" if "based_on" in written else HINT
        raise StrategyError(
            explained(error, f"{path}: {HEADING}{hint}", _keys())
        ) from error
    except S2C2AError as error:
        raise StrategyError(f"{path}: {error}") from error


def _keys() -> Iterator[str]:
    """Keys of all tables in recipes of the package."""
    tables = (
        Recipe,
        FitOptions,
        PlannerOptions,
        KalmanFilter,
        *MODELS.known.values(),
        *CONTROLLERS.known.values(),
    )
    for table in tables:
        for key in fields(table):
            yield key.name
    for path, registry in NESTED.items():
        for component in registry.known.values():
            for key in fields(component):
                yield f"{path}.{key.name}"


def recipe_in(table: dict[str, Any], find: Callable[[Registry, str], type]) -> Recipe:
    """Validate the table of a recipe.

    Args:
        table: as in a file.
        find: finds the class of a network's options: `Registry.named` or `imported`.

    Raises:
        S2C2AError: the table is no recipe.
        ValidationError: the same.
    """
    c2s = table.get("c2s")
    if not isinstance(c2s, dict) or not isinstance(c2s.get("model"), str):
        known = {key.name for key in fields(Recipe)} | {"based_on"}
        unknown = [str(key)[:MAX_NAME_LENGTH] for key in table if key not in known][:1]
        misspelled = "".join(f"{key}: {unknown_key(key, _keys())}; " for key in unknown)
        raise StrategyError(
            f"{misspelled}[c2s] names no forward model; write based_on = 'best' and "
            "what differs, or a line such as model = 'chain': one of "
            f"{', '.join(MODELS.known)}, or your own as module:Name or file.py:Name"
        )
    model = _validated("c2s", find(MODELS, c2s["model"]), c2s)
    c2a = table.get("c2a")
    controller_name = c2a.get("model", "bilstm") if isinstance(c2a, dict) else "bilstm"
    controller_type = find(CONTROLLERS, str(controller_name))
    controller = _validated("c2a", controller_type, c2a or {})
    validated = table | {"c2s": model, "c2a": controller}
    return TypeAdapter(Recipe).validate_python(validated)


def _validated(name: str, kind: type, table: Any) -> Any:
    """The options in a table of a recipe; errors name the keys with the table."""
    adapter = TypeAdapter(dict[str, kind])  # type: ignore[valid-type]
    return adapter.validate_python({name: table})[name]


def _complete(written: dict[str, Any], folder: Path) -> dict[str, Any]:
    """A table with everything that it is based on, and code files by their full path."""
    written = dict(written)
    if isinstance(written.get("planner"), dict):
        planner = dict(written["planner"])
        for key in ("solver", "terms", "guides"):
            if key in planner:
                planner[key] = _with_full_path(planner[key], folder, "name")
        written["planner"] = planner
    for key, tag in (("c2s", "model"), ("c2a", "model"), ("estimator", "name")):
        if isinstance(written.get(key), dict):
            written[key] = _with_full_path(written[key], folder, tag)
    base_name = written.pop("based_on", None)
    if base_name is None:
        return written
    return _merged(asdict(recipe_named(str(base_name))), written)


def _with_full_path(table: Any, folder: Path, key: str) -> Any:
    """A table, or several, whose `file.py:Name` names a file of the folder in full."""
    if isinstance(table, list):
        return [_with_full_path(entry, folder, key) for entry in table]
    if isinstance(table, str):
        table = {key: table}
    if not isinstance(table, dict):
        return table
    file_name, _, class_name = str(table.get(key)).rpartition(":")
    file = folder / file_name
    if not file.is_file():
        return table
    return table | {key: f"{file.resolve()}:{class_name}"}


def _merged(base: Any, changes: Any) -> Any:
    """Merge tables key by key, and lists of components by their names.

    Tables of different classes are not merged: then the changes replace the base.
    """
    base_components = _by_name(base)
    changed_components = _by_name(changes)
    if base_components and changed_components:
        return list(_merged(base_components, changed_components).values())
    if not isinstance(base, dict) or not isinstance(changes, dict):
        return changes
    if any(base.get(tag) != changes[tag] for tag in TAGS & changes.keys()):
        return changes
    merged = dict(base)
    for key, value in changes.items():
        merged[key] = _merged(base.get(key), value)
    return merged


def _by_name(values: Any) -> dict[str, Any]:
    """Components of a list by their names; empty for anything else."""
    if not isinstance(values, list | tuple):
        return {}
    if not all(isinstance(value, dict) and "name" in value for value in values):
        return {}
    return {value["name"]: value for value in values}


def save_recipe(recipe: Recipe, path: str | os.PathLike) -> Path:
    """Write a recipe to a file, replacing what is there."""
    table = asdict(recipe)
    del table["name"]
    return write_atomically(tomli_w.dumps(table), path)
