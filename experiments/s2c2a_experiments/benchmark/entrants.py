"""Who takes part in the benchmark: a strategy with its options and its recipe.

Every strategy can take part, also one in a file of its own: `--entry my.py:Mine`.
"""

import inspect
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from importlib import resources
from pathlib import Path
from types import ModuleType

import equinox as eqx
import jax
from pydantic import TypeAdapter

from s2c2a.arm import ArmSpec, load_arm
from s2c2a.arm.sensors import Camera
from s2c2a.errors import S2C2AError, StrategyError
from s2c2a.files.text import parse_toml
from s2c2a.jobs import GivenNetworks
from s2c2a.strategies import (
    STRATEGIES,
    Recipe,
    StrategyOptions,
    load_networks,
    recipe_named,
    shown_name,
    strategy_named,
)
from s2c2a_experiments.benchmark.search_space import (
    STRATEGY,
    Values,
    with_options,
    with_values,
)

TUNED = resources.files("s2c2a_experiments.benchmark").joinpath("tuned.toml")
"""What the same number of trials has found for each entrant (`tune`)."""
OWN = {
    "apf": ("gain=0.1:1:log", "damping=0.001:0.1:log"),
    "biarc": ("share=0.5:1", "change_weight=0.1:10:log"),
    "diff-ik": ("gain=0.03:1:log", "damping=0.001:0.1:log"),
    "drawn-curve": (
        "share=0.4:1",
        "tip_weight=3:100:log",
        "tangent_weight=0.005:0.5:log",
    ),
    "fuzzy": (
        "range=0.05:0.5:log",
        "change_range=0.05:1:log",
        "gain=0.03:0.6:log",
    ),
    "gmr": ("components=10:100:log", "bend_noise=0.03:1:log", "share=0.1:1:log"),
    "inverse-sampling": ("samples=16:64", "global_share=0:1", "pace=0.3:1"),
    "multi-ik": ("solutions=4:16", "reach_weight=10:1000:log", "pace=0.3:1"),
    "online-jacobian": (
        "gain=0.03:0.6:log",
        "learning=0.03:1:log",
        "damping=0.02:0.5:log",
    ),
    "pcc-one-step": (
        "change_weight=0.01:1:log",
        "evenness=0.005:0.1:log",
    ),
    "rrt": ("pace=0.3:1",),
    "rrt-star": ("pace=0.3:1",),
    "pseudo-rigid": (
        "change_weight=0.01:1:log",
        "evenness=0.005:0.1:log",
        "stiffness=0.5:2:log",
    ),
}
"""What the tuning of planners with a file of their own varies, over about ten times:
numbers that the tasks of the tuning depend on, which have no axes and no obstacles."""
_CODE = re.compile(r"^\s*[^\s#]", re.MULTILINE)


@dataclass(frozen=True)
class Entrant:
    """A planner of the benchmark.

    Attributes:
        name: in tables.
        family: of the paper's Table I, or of the field.
        strategy: see `strategy_named`.
        recipe: by which it is trained and plans.
        tuned: what its tuning varies; see `range_from`.
        camera: whether it sees the tip by a camera, as others by motion capture.
        is_own: whether the user has entered it.
        is_baseline: whether it runs on every task, whatever it ignores of goals.
        arms: that it is trained for, where that takes long; all if empty.
        simulated: control steps of the simulation that it learns from.
        weights: networks of the user's file; trained anew if None.
    """

    name: str
    family: str
    strategy: str
    recipe: Recipe
    tuned: tuple[str, ...] = ()
    camera: bool = False
    is_own: bool = False
    is_baseline: bool = False
    arms: tuple[str, ...] = ()
    simulated: int = 0
    weights: GivenNetworks | None = None

    @cached_property
    def options(self) -> StrategyOptions:
        """Options of its strategy."""
        return strategy_named(self.strategy)

    @property
    def samples(self) -> int:
        """Samples that it learns from; 0 for none."""
        if self.simulated:
            return self.simulated
        recipe = self.options.recipe(self.recipe)
        data = self.options.collect_options(recipe, 0)
        if not data:
            return 0
        return data.episodes * data.samples

    @cached_property
    def takes_payload(self) -> bool:
        """Whether a known payload changes what it plans."""
        if "known_payload" not in self.options.supports:
            return False
        recipe = self.options.recipe(self.recipe)
        shapes = eqx.filter_eval_shape(
            recipe.c2s.untrained, load_arm("twin_arm"), jax.random.key(0)
        )
        return shapes.takes_payload

    @property
    def lines(self) -> int:
        """Lines of its file with code or docstrings; see `code_lines`."""
        return code_lines(inspect.getmodule(type(self.options)))

    def sensed(self, arm: ArmSpec) -> ArmSpec:
        """The arm with the sensors of the entrant: a camera as good as motion capture."""
        if not self.camera:
            return arm
        camera = Camera(rate=arm.control_rate, delay=0.02, lost=0.0, noise=0.0005)
        sensors = arm.sensors.model_copy(update={"camera": camera})
        return arm.model_copy(update={"sensors": sensors})

    def with_values(self, values: Values) -> "Entrant":
        """The entrant with tuned values."""
        return replace(
            self,
            strategy=with_options(self.strategy, dict(values)),
            recipe=with_values(self.recipe, dict(values)),
        )


def code_lines(module: ModuleType | None) -> int:
    """Lines of a module that hold code or docstrings; blank ones and comments do not."""
    if module is None:
        return 0
    source = inspect.getsource(module)
    return len(_CODE.findall(source))


def is_plain(text: str) -> bool:
    """Whether terminals and tables show a text as it is, also as code in backquotes."""
    return text.isprintable() and "`" not in text


def entrant_of(strategy: str) -> Entrant:
    """An entrant by the name of a strategy, for `--entry`; it is not tuned.

    Raises:
        S2C2AError: there is no such strategy.
        StrategyError: no table can show its name.
    """
    kind = type(strategy_named(strategy))
    if not isinstance(kind.name, str) or not is_plain(name := shown_name(strategy)):
        raise StrategyError(
            f"name = {kind.name!r} in {kind.__name__} ({strategy!r}): write text of one "
            "line without backquotes"
        )
    return Entrant(name, "yours", strategy, recipe_named("best"), is_own=True)


def with_weights(entries: Sequence[Entrant], files: Sequence[Path]) -> list[Entrant]:
    """Entries with the networks of files, each for the arm of its file alone.

    Raises:
        S2C2AError: a file cannot be read, or belongs to none of them.
    """
    entries = list(entries)
    for file in files:
        arm = load_networks(file).arm
        given = GivenNetworks.read(file, arm)
        names = [STRATEGIES.name_of(type(each.options)) for each in entries]
        if given.strategy not in names:
            raise S2C2AError(
                f"{file} holds networks of {given.strategy}, and --entry is "
                f"{', '.join(names) or 'not given'}; add --entry {given.strategy}, or "
                "leave out the file"
            )
        number = names.index(given.strategy)
        if entries[number].weights is not None:
            raise S2C2AError(
                f"{file} is the second file of {given.strategy}; give one for each "
                "entry, and compare others by another call"
            )
        entries[number] = replace(
            entries[number], recipe=given.recipe, arms=(arm.name,), weights=given
        )
    return entries


def tuned_values() -> dict[str, Values]:
    """Tuned values by entrant and place."""
    if not TUNED.is_file():
        return {}
    tables = parse_toml(TUNED.read_text(encoding="utf-8"))
    return TypeAdapter(dict[str, Values]).validate_python(tables["values"])


def entrants() -> list[Entrant]:
    """All entrants of the project, tuned."""
    values = tuned_values()
    return [each.with_values(values.get(each.name, {})) for each in untuned()]


def untuned() -> list[Entrant]:
    """All entrants of the project, as their files have them."""
    # those with a file in `planners/`
    best = recipe_named("best")

    def own(name: str, family: str, **more) -> Entrant:
        places = tuple(f"{STRATEGY}{text}" for text in OWN.get(name, ()))
        return Entrant(name, family, name, best, places, **more)

    of_own_files = [
        own("apf", "potential field"),
        own("rrt", "RRT"),
        own("rrt-star", "RRT*"),
        own("gmr", "Gaussian mixture regression"),
        own("fuzzy", "fuzzy logic, tip seen"),
        own("multi-ik", "several solutions, dynamic programming"),
        own("inverse-sampling", "inverse model, sampling"),
        own("drawn-curve", "drawn curve, optimization"),
        own("biarc", "two arcs"),
        own("pcc-one-step", "forward model: arcs"),
        own("pseudo-rigid", "forward model: rigid links"),
        own("diff-ik", "differential inverse kinematics"),
        own("online-jacobian", "estimated Jacobian, tip seen"),
        own(
            "ppo",
            "reinforcement learning, tip seen",
            arms=("twin_arm",),
            simulated=60_800,
        ),
        own("still", "none: the arm keeps its bends", is_baseline=True),
    ]
    return [*of_own_files, *_by_recipes()]


def _by_recipes() -> list[Entrant]:
    """Those that a recipe of the package describes."""
    best = recipe_named("best")
    paper = recipe_named("paper")
    evenness = "planner.terms.Evenness.weight=0.005:0.1:log"
    horizon = ("planner.solver.iterations=1:60:log", evenness)
    adam = (
        "planner.solver.learning_rate=0.005:0.1:log",
        "planner.terms.Change.weight=0.3:3:log",
    )
    return [
        Entrant("pcc", "forward model: arcs (paper)", "pcc", paper, adam),
        Entrant("pcc-horizon", "horizon, arcs", "pcc", best, horizon),
        Entrant("pcc-fitted", "horizon, fitted arcs", "pcc-fitted", best, horizon),
        Entrant("paper", "forward model: biLSTM", "s2c2a", paper, adam),
        Entrant("best", "horizon, gray box", "s2c2a", best, horizon),
        Entrant(
            "best-camera", "horizon, tip seen", "s2c2a", best, horizon, camera=True
        ),
    ]
