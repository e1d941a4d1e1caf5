"""Strategy `policy`: a network that was trained in an environment, from a weight file.

The file has the form of all weight files and runs no code. What it was trained with is
not needed to run it.
"""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import ClassVar, Literal

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmSpec
from s2c2a.errors import StrategyError
from s2c2a.integrations.environments.spaces import (
    BatchMoment,
    Controls,
    joined,
    observation_parts,
    observe,
)
from s2c2a.planning import Goal
from s2c2a.runtime import Driver
from s2c2a.spaces import POSITION, Actions, Reading
from s2c2a.strategies import (
    STRATEGIES,
    StrategyOptions,
    TrainedNetworks,
    check_new_networks,
    recipe_named,
    save_networks,
)
from s2c2a.training import Trained

Layer = tuple[Float[np.ndarray, "out in"], Float[np.ndarray, " out"]]
ACTIVATIONS: Mapping[str, Callable[[np.ndarray], np.ndarray]] = {
    "relu": lambda values: np.maximum(values, 0.0),
    "tanh": np.tanh,
}
NETWORK = "policy"


@dataclass(frozen=True)
class PolicyStrategy(StrategyOptions):
    """A multilayer perceptron from observations to actions, as `spaces` describes them.

    It follows the tip's position; other goals and obstacles have no influence.

    Attributes:
        width: neurons of each hidden layer.
        depth: number of hidden layers; 0 for a linear policy.
        activation: of the hidden layers, "relu" or "tanh".
        squashed: whether actions are the tangens hyperbolicus of the outputs; else
            these are limited to +-1.
    """

    width: int = 128
    depth: int = 2
    activation: Literal["relu", "tanh"] = "relu"
    squashed: bool = True

    name = "policy"
    recipe_keys = frozenset()
    ignores = frozenset({"axes", "other ends", "obstacles"})
    limits: ClassVar[dict] = {"width": (1, 4096), "depth": (0, 8)}

    def untrained(self, arm, recipe, key):
        controls = Controls.of(arm)
        return {
            NETWORK: eqx.nn.MLP(
                observation_size(controls),
                controls.count,
                self.width,
                self.depth,
                key=key,
            )
        }

    def build(self, arm, recipe, trained, run) -> Driver:
        if trained is None:
            raise StrategyError(
                "the strategy 'policy' needs a trained one; give its file with --weights"
            )
        network = trained.networks[NETWORK]
        layers = [
            (np.asarray(layer.weight), np.asarray(layer.bias))
            for layer in network.layers
        ]
        return PolicyDriver(arm, layers, self)


def observation_size(controls: Controls) -> int:
    """Number of values of an observation without an obstacle."""
    return max(part.stop for part in observation_parts(controls).values())


class PolicyDriver:
    """A trained policy in the control loop.

    Attributes:
        name: "policy".
        arm: that it drives.
        sensors: encoders, and states of which it uses the tip's.
    """

    name = "policy"
    sensors = ("cables", "states")

    def __init__(self, arm: ArmSpec, layers: Sequence[Layer], options: PolicyStrategy):
        self.arm = arm
        self._controls = Controls.of(arm)
        self._layers = layers
        self._activation = ACTIVATIONS[options.activation]
        self._squashed = options.squashed
        self._begin(np.zeros(3))

    def _begin(self, tip: Float[np.ndarray, "3"]) -> None:
        self._command = self._controls.geometry.action_neutral
        self._action = np.zeros(self._controls.count)
        self._last_goal = tip

    def start(self, reading: Reading) -> None:
        """See `runtime.Driver.start`."""
        self._begin(reading["states"][-1, POSITION])

    def estimate(self, reading: Reading, last_command: Actions) -> Reading:
        """See `runtime.Driver.estimate`."""
        self._command = last_command
        return reading

    def plan(self, estimate: Reading, goal: Goal) -> Float[np.ndarray, " controls"]:
        """Actions for a goal; zero without a position of the tip."""
        if goal.position_weights[-1] == 0.0:
            self._action = np.zeros(self._controls.count)
            return self._action
        target = np.asarray(goal.positions[-1], float)
        moment = BatchMoment(
            estimate["cables"][None],
            self._command[None],
            self._action[None],
            estimate["states"][None],
            self._last_goal[None],
            target[None],
            np.zeros((1, 4)),
            np.zeros(1, int),
        )
        observation = joined(observe(self._controls, moment))[0]
        self._last_goal = target
        self._action = self._act(observation).astype(float)
        return self._action

    def act(self, plan: Float[np.ndarray, " controls"], estimate: Reading) -> Actions:
        """See `runtime.Driver.act`."""
        step = plan * self._controls.geometry.step_limit
        return self._controls.commands(self._controls.bends(self._command) + step)

    def sent(self, action: Actions) -> None:
        """See `runtime.Driver.sent`."""
        self._command = action

    def diagnostics(self) -> dict[str, np.ndarray]:
        """See `runtime.Driver.diagnostics`."""
        return {}

    def _act(self, values: np.ndarray) -> Float[np.ndarray, " controls"]:
        *hidden, (weight, bias) = self._layers
        for hidden_weight, hidden_bias in hidden:
            values = self._activation(hidden_weight @ values + hidden_bias)
        outputs = weight @ values + bias
        return np.tanh(outputs) if self._squashed else np.clip(outputs, -1.0, 1.0)


def save_policy(
    path: str | os.PathLike,
    arm: ArmSpec,
    layers: Sequence[Layer],
    activation: Literal["relu", "tanh"] = "relu",
    squashed: bool = True,
    seed: int = 0,
    overwrite: bool = False,
) -> None:
    """Write a policy as a weight file, for `s2c2a run --strategy policy --weights FILE`.

    Args:
        path: of the file, such as "reach.safetensors".
        arm: that it was trained for.
        layers: weights and biases from observation to action; all hidden layers are
            equally wide.
        activation: of the hidden layers.
        squashed: see `PolicyStrategy`.
        seed: of the training.
        overwrite: whether an existing file is replaced.

    Raises:
        StrategyError: the file exists, or the layers do not fit each other or the arm.
    """
    check_new_networks(path, overwrite)
    if activation not in ACTIVATIONS:
        raise StrategyError(
            f"activation '{activation}' was given; choose one of {', '.join(ACTIVATIONS)}"
        )
    width = len(layers[0][1])
    options = PolicyStrategy(width, len(layers) - 1, activation, squashed)
    recipe = recipe_named("best")
    blank = options.untrained(arm, recipe, jax.random.key(0))[NETWORK]
    expected = [(layer.weight.shape, layer.bias.shape) for layer in blank.layers]
    given = [(np.shape(weight), np.shape(bias)) for weight, bias in layers]
    if given != expected:
        raise StrategyError(
            f"the layers have the shapes {given}; this arm needs {expected}, from "
            "observations without an obstacle to actions"
        )
    numbers = [np.asarray(array, np.float32) for layer in layers for array in layer]
    if not all(np.isfinite(array).all() for array in numbers):
        raise StrategyError("a weight of the policy is not finite; train it anew")
    filled = eqx.tree_at(
        lambda network: [
            array for layer in network.layers for array in (layer.weight, layer.bias)
        ],
        blank,
        numbers,
    )
    networks = TrainedNetworks(
        arm,
        recipe,
        seed,
        {NETWORK: Trained(filled)},
        strategy=STRATEGIES.name_of(PolicyStrategy),
        strategy_options=asdict(options),
    )
    save_networks(networks, path)
