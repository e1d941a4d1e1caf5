"""Recipes: everything that is chosen about networks, training and planning, under one name, or in a file (TOML).

Files are what a sweep finds, and what a user writes down.
"""

import math
import os
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import tomli_w
from jaxtyping import PRNGKeyArray
from pydantic import ConfigDict, TypeAdapter, ValidationError

from s2c2a.arm import ArmSpec
from s2c2a.arm.sensors import Sensors
from s2c2a.data import CollectOptions
from s2c2a.data.babbling import BABBLING, SPEEDS
from s2c2a.data.collecting import MAX_EPISODES
from s2c2a.errors import S2C2AError, StrategyError
from s2c2a.estimation import Swing, untrained_sensors
from s2c2a.validation import explained
from s2c2a.files import read_text, save_whole, toml_in
from s2c2a.models import C2AOptions, C2SOptions, ForwardOptions, LocalOptions
from s2c2a.models.registry import MODELS, code_of, model_named, name_of
from s2c2a.planning import BEST, PAPER, PlannerOptions
from s2c2a.sensing import DirectionEstimator, Estimator, estimator_for
from s2c2a.training.fit import FitOptions, check_limits

ENDING = ".toml"
HEADING = "{count} fault(s) in the recipe"
HINT = " (with a line such as based_on = 'best' a file need not say all)"
TAGS = {"name", "model"}
"""What says of which form a table is."""


@dataclass(frozen=True)
class Recipe:
    """How a strategy is trained and how it plans.

    Attributes:
        name: the word a user types.
        c2s: the forward model: the paper's biLSTM, the chain with memory, or one of the
            user's own.
        c2a: the controller.
        c2s_fit: how the forward model is trained.
        c2a_fit: how the controller is trained.
        history_noise: on past actions while the controller is trained, normalized.
        planner: how to plan.
        babbling: how data explore the arm (`data.babbling.BABBLING`).
        speeds: of their motion, as parts of the full bend per step, slowest and
            fastest.
        episodes: number of episodes of its data.
        correction: part of the controller's lasting error that is integrated in every
            step; none if zero.
        axis_weights: what mu_o of the protocol's tasks is multiplied by, for names that
            begin so.
        directions: whether sensed vectors are taken at unit length, whatever mixes
            them.
        observes: whether plans are made in what motors do, and all else that is sensed
            says what comes of it (`estimation`); else plans are made in what is sensed,
            as in the paper.
    """

    name: str
    c2s: ForwardOptions
    c2a: C2AOptions
    c2s_fit: FitOptions = field(default_factory=FitOptions)
    c2a_fit: FitOptions = field(default_factory=FitOptions)
    history_noise: float = 0.05
    planner: PlannerOptions = PAPER
    babbling: str = "staged"
    speeds: tuple[float, float] = SPEEDS
    episodes: int = 18
    correction: float = 0.0
    axis_weights: tuple[tuple[str, float], ...] = ()
    directions: bool = False
    observes: bool = False

    __pydantic_config__ = ConfigDict(extra="forbid")

    def __post_init__(self):
        """Refuse numbers that are none, or absurd; a forward model of one's own goes by the name of its class."""
        limits = {
            "history_noise": (0, 1000),
            "speeds": (0, 10),
            "episodes": (1, MAX_EPISODES),
            "correction": (0, 10),
        }
        check_limits(self, StrategyError, **limits)
        if self.babbling not in BABBLING:
            raise StrategyError(
                f"babbling = '{self.babbling}' was asked for; take {', '.join(BABBLING)}"
            )
        if not all(0 <= weight <= 1e6 for _, weight in self.axis_weights):
            raise StrategyError(
                f"axis_weights = {self.axis_weights} was asked for; take weights of 0 to 1e6"
            )
        if wrong := [
            place
            for place, number in _numbers("planner", asdict(self.planner))
            if not math.isfinite(number)
        ]:
            raise StrategyError(
                f"recipe '{self.name}' has no finite number at {', '.join(wrong)}; write one there"
            )
        if not self.c2s.model:
            object.__setattr__(
                self, "c2s", replace(self.c2s, model=name_of(type(self.c2s)))
            )

    @property
    def training(self) -> dict[str, Any]:
        """What trained networks depend on: all but how many data and how they are put to work; a user's code, too."""
        at_work = ("name", "episodes", "planner", "correction", "axis_weights")
        here = {
            name: value for name, value in asdict(self).items() if name not in at_work
        }
        return here | {"code": code_of(type(self.c2s))}

    def collect_options(self, seed: int = 0) -> CollectOptions:
        """How data for it are collected.

        Raises:
            RecordingError: the recipe's speeds are none.
        """
        return CollectOptions(
            self.babbling, self.episodes, seed=seed, speeds=self.speeds
        )

    def untrained(self, arm: ArmSpec, key: PRNGKeyArray) -> dict[str, Any]:
        """Both networks before training; how the arm swings, and what its sensors say, if that is asked for."""
        felt = self.felt(arm)
        networks = {
            "C2S": self.c2s.untrained(felt, key),
            "C2A": self.c2a.untrained(felt, key),
        }
        return networks | (
            {"swing": Swing.nominal()} | untrained_sensors(arm, key)
            if self.observes
            else {}
        )

    def axis_weight(self, task: str) -> float:
        """What mu_o of a task is multiplied by."""
        return next(
            (weight for begin, weight in self.axis_weights if task.startswith(begin)),
            1.0,
        )

    def felt(self, arm: ArmSpec) -> ArmSpec:
        """The arm as plans are made for it: what watches it beside its motors has no say in them."""
        if not self.observes:
            return arm
        motor = arm.motor.model_copy(
            update={"current_noise": None, "current_friction": 0.0}
        )
        sensing = "encoders" if arm.sensing == "true" else arm.sensing
        return arm.model_copy(
            update={"sensing": sensing, "sensors": Sensors(), "motor": motor}
        )

    def learned_on(self, arm: ArmSpec) -> ArmSpec:
        """The arm as networks are trained for it: as plans are made, and with sensors that have to be learned."""
        return (
            self.felt(arm).model_copy(update={"sensors": arm.sensors.learned})
            if self.observes
            else arm
        )

    def estimator(self, arm: ArmSpec) -> Estimator:
        """What turns the arm's readings into the configurations that this recipe works on."""
        estimator = estimator_for(self.felt(arm))
        return DirectionEstimator(estimator) if self.directions else estimator


def _numbers(place: str, value: Any) -> Iterator[tuple[str, float]]:
    """Every number within, and where it stands."""
    if isinstance(value, float):
        yield place, value
    inside = (
        value.items()
        if isinstance(value, dict)
        else enumerate(value)
        if isinstance(value, list | tuple)
        else ()
    )
    for name, part in inside:
        yield from _numbers(f"{place}.{name}", part)


_DECAYING = FitOptions(
    learning_rate=2e-3, max_epochs=60, patience=60, epochs_per_call=10, decay=True
)

_BEST = Recipe(
    "best",
    c2s=LocalOptions(),
    c2a=C2AOptions(layers=2, hidden=32),
    c2s_fit=_DECAYING,
    c2a_fit=_DECAYING,
    planner=BEST,
    babbling="mixed",
    speeds=(0.02, 0.06),
    correction=0.2,
    axis_weights=(("hold-", 3.0),),
    directions=True,
    observes=True,
)
_PAPER = Recipe(
    "paper", c2s=C2SOptions(layers=4, hidden=64), c2a=C2AOptions(layers=2, hidden=32)
)
RECIPES = {
    one.name: one
    for one in (_BEST, replace(_BEST, name="best-long", episodes=72), _PAPER)
}
"""What each ingredient of `best` is worth, and who needs four times its data:
docs/recipe.md."""


def recipe_named(name: str) -> Recipe:
    """Look a recipe up.

    Raises:
        StrategyError: no such recipe.
    """
    if name not in RECIPES:
        raise StrategyError(f"no recipe '{name}'; choose one of {', '.join(RECIPES)}")
    return RECIPES[name]


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
        StrategyError: no such file, not TOML, or no recipe: a key is missing, not known
            or of another kind.
    """
    if not Path(path).is_file():
        raise StrategyError(
            f"no recipe at {path}; take {', '.join(RECIPES)}, or a file such as `s2c2a sweep` writes"
        )
    if Path(path).stem in RECIPES:
        raise StrategyError(
            f"{path} would go by the name of a recipe that is another; give the file a name of its own"
        )
    try:
        written = toml_in(read_text(path))
        recipe = recipe_in(
            _in_full(written, Path(path).parent) | {"name": Path(path).stem},
            model_named,
        )
        recipe.planner.made()  # now, not after the training
        return recipe
    except ValidationError as error:
        hint = "" if "based_on" in written else HINT
        raise StrategyError(
            explained(error, f"{path}: {HEADING}{hint}", _keys())
        ) from error
    except S2C2AError as error:
        raise StrategyError(f"{path}: {error}") from error


def _keys() -> Iterator[str]:
    """Of every table that recipes of ours have."""
    for kind in (Recipe, C2AOptions, FitOptions, PlannerOptions, *MODELS.values()):
        yield from (one.name for one in fields(kind))


def recipe_in(
    table: dict[str, Any], model: Callable[[str], type[ForwardOptions]]
) -> Recipe:
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
    options = TypeAdapter(model(c2s["model"])).validate_python(c2s)
    return TypeAdapter(Recipe).validate_python(table | {"c2s": options})


def _in_full(written: dict[str, Any], folder: Path) -> dict[str, Any]:
    """With all of the recipe that it is based on, and files of code beside it found from anywhere."""
    if isinstance(planner := written.get("planner"), dict):
        parts = {
            key: _beside(planner[key], folder)
            for key in ("solver", "terms", "guides")
            if key in planner
        }
        written = written | {"planner": planner | parts}
    if isinstance(c2s := written.get("c2s"), dict):
        written = written | {"c2s": _beside(c2s, folder, "model")}
    if "based_on" not in written:
        return written
    base = asdict(recipe_named(str(written["based_on"])))
    return _merged(
        base, {key: value for key, value in written.items() if key != "based_on"}
    )


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
    if (parts := _by_name(base)) and (own_parts := _by_name(own)):
        return list(_merged(parts, own_parts).values())
    tables = isinstance(base, dict) and isinstance(own, dict)
    if not tables or any(base.get(tag) != own[tag] for tag in TAGS & own.keys()):
        return own
    return base | {key: _merged(base.get(key), value) for key, value in own.items()}


def _by_name(values: Any) -> dict[str, Any]:
    """Parts of a list by their names; nothing of what is no list of parts."""
    parts = isinstance(values, list | tuple) and all(
        isinstance(one, dict) and "name" in one for one in values
    )
    return {part["name"]: part for part in values} if parts else {}


def save_recipe(recipe: Recipe, path: str | os.PathLike) -> Path:
    """Write a recipe; replaces what is there."""
    written = {name: value for name, value in asdict(recipe).items() if name != "name"}
    return save_whole(tomli_w.dumps(written), path)
