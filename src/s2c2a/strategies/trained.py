"""Trained networks of an arm, what strategies are made from: how they came about, and the files that keep them.

For the form of files see `checkpoint`.
"""

import os
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any, Generic, TypeVar

import equinox as eqx
import jax
import numpy as np
from jaxtyping import PRNGKeyArray
from pydantic import TypeAdapter

import s2c2a
from s2c2a.arm import ArmSpec, arm_from_toml, arm_to_toml
from s2c2a.errors import StrategyError
from s2c2a.estimation import PREFIX
from s2c2a.kinematics import ForwardModel
from s2c2a.models import C2A, LSTMOptions
from s2c2a.models.registry import model_known, name_of
from s2c2a.strategies.checkpoint import (
    SCHEMA,
    Arrays,
    Metadata,
    damaged,
    filled,
    learned,
    read,
    write,
)
from s2c2a.strategies.recipe import Recipe, recipe_in
from s2c2a.training import Trained

Options = TypeVar("Options")

SPARED = "swing", PREFIX
"""How names begin of what files may lack: the arm's description then says it, or
nothing does."""
S2C2A = "s2c2a"
LSTM = "lstm"
CURVE = "curve."


@dataclass(frozen=True)
class TrainedNetworks(Generic[Options]):
    """The networks of one strategy.

    Attributes:
        arm: what they were trained for.
        recipe: how they were trained, and how to plan with them.
        seed: of the training.
        networks: by name: "C2S" and "C2A", or "LSTM".
        percent: held-out errors, network -> mean and standard deviation [% of full
            range].
        curves: network -> rows of epoch, training loss, validation loss.
    """

    arm: ArmSpec
    recipe: Options
    seed: int
    networks: Mapping[str, Any]
    percent: Mapping[str, tuple[float, float]]
    curves: Mapping[str, np.ndarray]

    @classmethod
    def of(
        cls, arm: ArmSpec, recipe: Options, seed: int, trained: Mapping[str, Trained]
    ) -> "TrainedNetworks[Options]":
        """What training says of each network, side by side."""
        said = (
            {name: getattr(one, part) for name, one in trained.items()}
            for part in ("network", "percent", "curve")
        )
        return cls(arm, recipe, seed, *said)

    def with_trained(
        self, trained: Mapping[str, Trained], recipe: Options
    ) -> "TrainedNetworks[Options]":
        """The same with some of them trained as a recipe says."""
        networks = {
            **self.networks,
            **{name: one.network for name, one in trained.items()},
        }
        percent = {
            **self.percent,
            **{name: one.percent for name, one in trained.items()},
        }
        curves = {**self.curves, **{name: one.curve for name, one in trained.items()}}
        return replace(
            self, recipe=recipe, networks=networks, percent=percent, curves=curves
        )

    @property
    def c2s(self) -> ForwardModel:
        """The forward model of the paper's strategy."""
        return self.networks["C2S"]

    @property
    def c2a(self) -> C2A:
        """Its controller."""
        return self.networks["C2A"]


def save_strategy(networks: TrainedNetworks[Recipe], path: str | os.PathLike) -> None:
    """Write the networks of the paper's strategy; the file appears whole or not at all.

    Raises:
        S2C2AError: the file cannot be written.
    """
    c2s = networks.recipe.c2s
    # who reads the file says what may be imported
    planner = replace(networks.recipe.planner, own_code=True)
    by_class = replace(
        networks.recipe, c2s=replace(c2s, model=name_of(type(c2s))), planner=planner
    )
    _save(replace(networks, recipe=by_class), S2C2A, path)


def save_lstm(networks: TrainedNetworks[LSTMOptions], path: str | os.PathLike) -> None:
    """Write a trained LSTM; the file appears whole or not at all.

    Raises:
        S2C2AError: the file cannot be written.
    """
    _save(networks, LSTM, path)


def load_strategy(
    path: str | os.PathLike, arm: ArmSpec | None = None
) -> TrainedNetworks[Recipe]:
    """Read the networks of the paper's strategy, for an arm if one is given.

    A forward model that does not come with the package must have been imported before:
    see `model_named`.

    Raises:
        StrategyError: no such file, damaged, of another kind or schema, or trained for
            another arm.
    """
    return _load(path, arm, S2C2A, _recipe_without_code, Recipe.untrained)


def load_lstm(
    path: str | os.PathLike, arm: ArmSpec | None = None
) -> TrainedNetworks[LSTMOptions]:
    """Read a trained LSTM, for an arm if one is given.

    Raises:
        StrategyError: no such file, damaged, of another kind or schema, or trained for
            another arm.
    """
    return _load(
        path, arm, LSTM, TypeAdapter(LSTMOptions).validate_python, _untrained_lstm
    )


def arm_of_strategy(path: str | os.PathLike) -> ArmSpec:
    """The arm that a strategy was trained for.

    Raises:
        StrategyError: no such file, damaged, of another kind or schema.
    """
    return _arm(read(path, S2C2A)[0], path)


def _save(networks: TrainedNetworks[Any], kind: str, path: str | os.PathLike) -> None:
    metadata = Metadata(
        schema_version=SCHEMA,
        version=s2c2a.__version__,
        kind=kind,
        arm=arm_to_toml(networks.arm),
        recipe=asdict(networks.recipe),
        seed=networks.seed,
        percent=networks.percent,
    )
    curves = {
        f"{CURVE}{name}": np.asarray(curve) for name, curve in networks.curves.items()
    }
    write(path, metadata, learned(networks.networks) | curves)


def _load(
    path: str | os.PathLike,
    arm: ArmSpec | None,
    kind: str,
    recipe_of: Callable[[dict], Options],
    untrained: Callable[[Options, ArmSpec, PRNGKeyArray], dict[str, Any]],
) -> TrainedNetworks[Options]:
    metadata, arrays = read(path, kind)
    trained_for = _arm(metadata, path)
    if arm is not None and not arm.same_mechanics(trained_for):
        raise StrategyError(
            f"{path} was trained for '{trained_for.name}', which differs from '{arm.name}' in "
            f"{', '.join(arm.differences(trained_for))}; train one for this arm with `s2c2a train`"
        )
    with damaged(path):
        recipe = recipe_of(metadata.recipe)
        blanks = eqx.filter_eval_shape(
            untrained, recipe, trained_for, jax.random.key(0)
        )
        blanks = {
            name: one
            for name, one in blanks.items()
            if name in metadata.percent or not name.startswith(SPARED)
        }
        networks = filled(blanks, trained_for, arrays)
        curves = _curves(arrays)
        if not set(networks) == set(curves) == set(metadata.percent):
            raise StrategyError("it lacks what is known of its training")
    return TrainedNetworks(
        arm or trained_for, recipe, metadata.seed, networks, metadata.percent, curves
    )


def _recipe_without_code(table: dict[str, Any]) -> Recipe:
    """A file that may be a stranger's names no code to be imported."""
    planner = table.get("planner")
    planner = planner | {"own_code": False} if isinstance(planner, dict) else planner
    return recipe_in(table | {"planner": planner}, model_known)


def _untrained_lstm(
    options: LSTMOptions, arm: ArmSpec, key: PRNGKeyArray
) -> dict[str, Any]:
    return {"LSTM": options.untrained(arm, key)}


def _arm(metadata: Metadata, path: str | os.PathLike) -> ArmSpec:
    with damaged(path):
        return arm_from_toml(metadata.arm, f"arm in {path}")


def _curves(arrays: Arrays) -> dict[str, np.ndarray]:
    curves = {
        name.removeprefix(CURVE): curve
        for name, curve in arrays.items()
        if name.startswith(CURVE)
    }
    for name, curve in curves.items():
        if curve.ndim != 2 or curve.shape[1] != 3 or not np.isfinite(curve).all():
            raise StrategyError(
                f"the curve of {name} has no rows of epoch, training and validation loss"
            )
    return curves
