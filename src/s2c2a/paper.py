"""The paper in one file: from random motion to a circle, in the order of the paper.

Z. Chen et al., "A Versatile Neural Network Configuration Space Planning and Control
Strategy for Modular Soft Robot Arms", IEEE T-RO, 2025 (https://arxiv.org/abs/2410.03483).
Section and equation numbers are the paper's; "Differs" marks what the paper does not
state or what did not work as stated (docs/concepts/deviations.md).

    python -m s2c2a.paper

collects data with the simulated twin of the paper's arm, trains both networks and
follows the circle of sec. IV-B. The recipe `paper` of the toolbox computes the same, for
any arm, with checks of its inputs, a safe control loop and files.
"""

import argparse
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Array, Float, PRNGKeyArray

from s2c2a.arm import ArmGeometry, ArmSpec, load_arm
from s2c2a.errors import ArmError
from s2c2a.goals import Goal
from s2c2a.kinematics import (
    bends_from_configurations,
    configurations_from_bends,
    limit_lengths,
)
from s2c2a.spaces import ACTION_HISTORY, AXIS, CONFIGURATION_HISTORY, POSITION

if TYPE_CHECKING:  # the planner imports this file, and needs no simulation
    from s2c2a.robots.simulation import SimulatedRobot

Configurations = Float[Array, "*batch modules 3"]
"""C: direction of each module's end in the frame of its base (sec. II-B)."""
States = Float[Array, "*batch modules 6"]
"""S: position [m] and direction of each module's end, base frame (sec. II-B)."""
Displacements = Float[Array, "*batch modules 3"]
"""a of sec. II-C, or actions A of sec. III [m]; normalized where a text says so."""
Inputs = Float[Array, "*batch modules features"]
Key = PRNGKeyArray

# ---------------------------------------------------- II-C. Configuration estimation


def configurations_from_encoders(
    arm: ArmSpec, displacements: Displacements
) -> Configurations:
    """Configurations C from the cable displacements that encoders measure [m]."""
    geometry = ArmGeometry.of(arm)
    # eq. (1) holds but for noise and backlash: what all cables have in common
    a = displacements - displacements.mean(axis=-1, keepdims=True)
    a_1 = a[..., 0]
    difference = (a[..., 1] - a[..., 2]) / np.sqrt(3)
    phi = jnp.sqrt(a_1**2 + difference**2) / geometry.cable_radii  # eq. (2)
    theta = jnp.arctan2(-a_1, difference)
    # the first cable of module II is not at 0 but at 60 deg (sec. II-A)
    azimuth = theta - np.pi / 2 + first_cable_angles(arm)
    o_x = jnp.sin(phi) * jnp.cos(azimuth)  # eq. (3)
    o_y = jnp.sin(phi) * jnp.sin(azimuth)
    o_z = jnp.cos(phi)
    return jnp.stack([o_x, o_y, o_z], axis=-1)


def first_cable_angles(arm: ArmSpec) -> Float[np.ndarray, " modules"]:
    """Angle of each module's first cable [rad]; the others follow at 120 deg.

    Raises:
        ArmError: the arm is not of the paper's kind.
    """
    angles = np.array([module.cable_angles_deg for module in arm.modules])
    even = angles.shape[1] == 3 and np.allclose(np.diff(angles), 120.0)
    if not (even and arm.actuation == "displacement" and arm.sensing == "encoders"):
        raise ArmError(
            f"'{arm.name}' is not of the paper's kind: three cables at 120 deg a module, "
            "displacements, encoders; for it use s2c2a collect and s2c2a train with "
            "--recipe paper"
        )
    return np.deg2rad(angles[:, 0])


# ------------------------------------------------------------- II-D. Data collection

Speeds = tuple[float, float]
SPEEDS: Speeds = (0.03, 0.22)
"""Slowest and fastest motion of the data, in full bends a step of the paper's arm.

Differs: the paper states no speeds; a controller trained at one speed fails at others.
"""
STEP_LIMIT_DEG = 4.0  # of the arm that SPEEDS were chosen for


SAMPLES = 500  # of an episode: 18 episodes are the 9000 samples of the paper


class Recording(NamedTuple):
    """Data of all episodes, each from rest; C is sensed, S is the true state.

    Attributes:
        configurations: C, shape (episodes, samples, modules, 3).
        states: S [m, 1], shape (episodes, samples, modules, 6).
        actions: A, displacements sent [m], shape (episodes, samples, modules, 3).
    """

    configurations: np.ndarray
    states: np.ndarray
    actions: np.ndarray


def speeds_on(arm: ArmSpec, speeds: Speeds = SPEEDS) -> Speeds:
    """Speeds in full bends a step, scaled to the step limit of an arm."""
    scale = arm.step_limit_deg / STEP_LIMIT_DEG
    slow, fast = speeds
    return min(slow * scale, 1.0), min(fast * scale, 1.0)


def disc_points(
    random: np.random.Generator, shape: tuple[int, ...]
) -> Float[np.ndarray, "*shape 2"]:
    """Uniform random points in the unit disc."""
    radius = np.sqrt(random.uniform(size=shape))
    angle = random.uniform(0, 2 * np.pi, size=shape)
    return radius[..., None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def bend_path(
    samples: int, random: np.random.Generator, speeds: Speeds = SPEEDS
) -> Float[np.ndarray, "samples 2"]:
    """Random motion of one module: lines to random bends at log-uniform speeds."""
    position = np.zeros(2)
    path: list[np.ndarray] = []
    while len(path) < samples:
        target = disc_points(random, ())
        speed = np.exp(random.uniform(*np.log(speeds)))
        steps = max(1, int(np.ceil(np.linalg.norm(target - position) / speed)))
        shares = np.arange(1, steps + 1)[:, None]
        path.extend(position + (target - position) * shares / steps)
        position = target
    return np.array(path[:samples])


def staged_shares(
    modules: int, progress: float
) -> Float[np.ndarray, "modules sequences"]:
    """Share of each random sequence in each module's motion (fig. 3C).

    All modules follow a_I in the first third of the data; all but the last, which
    follows a_III, in the second; each its own in the last.
    """
    if progress < 1 / 3:
        return np.ones((modules, 1))
    if progress < 2 / 3 and modules > 1:
        return np.eye(2)[[0] * (modules - 1) + [1]]
    return np.eye(modules)


def mixed_bends(
    shares: Float[np.ndarray, "modules sequences"],
    samples: int,
    random: np.random.Generator,
    speeds: Speeds,
) -> Float[np.ndarray, "samples modules 2"]:
    """Bends of all modules, in shares of the full bend: a mixture of random paths."""
    paths = [bend_path(samples, random, speeds) for _ in range(shares.shape[1])]
    mixed = np.einsum("mp,spk->smk", shares, np.stack(paths, axis=1))
    return mixed / np.maximum(np.linalg.norm(mixed, axis=-1, keepdims=True), 1.0)


def babbling(
    arm: ArmSpec, episode: int, episodes: int, samples: int, seed: int
) -> Float[np.ndarray, "samples modules 3"]:
    """Actions of one episode of staged babbling [m]."""
    random = np.random.default_rng(np.random.SeedSequence([seed, episode]))
    shares = staged_shares(arm.module_count, episode / episodes)
    bends = mixed_bends(shares, samples, random, speeds_on(arm))
    return ArmGeometry.of(arm).actions_at(bends)


def collect(
    arm: ArmSpec,
    make_robot: "Callable[[int], SimulatedRobot]",
    episodes: int,
    samples: int,
    seed: int = 0,
) -> Recording:
    """Record random motion of a simulated arm; `make_robot` makes one from a seed.

    Real arms need the limits and the emergency stop of `s2c2a collect`.
    """
    rows = []
    for episode in range(episodes):
        stream = np.random.SeedSequence([seed, episode, 1])
        robot = make_robot(int(stream.generate_state(1)[0]))
        robot.open()
        for action in babbling(arm, episode, episodes, samples, seed):
            reading = robot.read()
            rows.append((reading["cables"], reading["states"], action))
            robot.step(action)
    columns = [np.array(column) for column in zip(*rows, strict=True)]
    cables, states, actions = [
        column.reshape(episodes, samples, *column.shape[1:]) for column in columns
    ]
    sensed = configurations_from_encoders(arm, jnp.asarray(cables, jnp.float32))
    return Recording(np.asarray(sensed), states, actions)


# ---------------------------------------------------- III-A. Configuration planning, S2C


class Scaling(eqx.Module):
    """Map of each feature from `center` +- `half_range` to [-1, 1]."""

    center: Float[Array, " features"]
    half_range: Float[Array, " features"]

    @classmethod
    def of(cls, values: Float[np.ndarray, "*batch features"]) -> Self:
        """The map from the range of the values; a constant feature keeps its unit."""
        flat = values.reshape(-1, values.shape[-1])
        low = flat.min(axis=0)
        high = flat.max(axis=0)
        half_range = np.where(high > low, (high - low) / 2, 1.0)
        return cls(_float32((low + high) / 2), _float32(half_range))

    @classmethod
    def of_states(cls, states: Float[np.ndarray, "*batch 6"]) -> Self:
        """The map of states: one scale for x, y and z, none for axes; NaN is unknown.

        Differs: with one scale for each axis, obstacles would not stay spheres.
        """
        positions = states[..., POSITION].reshape(-1, 3)
        low = np.nanmin(positions, axis=0)
        high = np.nanmax(positions, axis=0)
        half_width = (high - low).max() / 2
        center = np.concatenate([(low + high) / 2, np.zeros(3)])
        half_range = np.concatenate([np.full(3, half_width), np.ones(3)])
        return cls(_float32(center), _float32(half_range))

    def forward(self, values: Float[Array, "*batch features"]) -> Array:
        """To [-1, 1]."""
        return (values - self.center) / self.half_range

    def back(self, values: Float[Array, "*batch features"]) -> Array:
        """From [-1, 1]."""
        return values * self.half_range + self.center


UNROLLED = 8  # modules; only longer arms compile to a loop


class Direction(eqx.Module):
    """LSTM layer in one direction; gates are ordered input, forget, cell, output."""

    weight_input: Float[Array, "features gates"]
    weight_hidden: Float[Array, "hidden gates"]
    bias: Float[Array, " gates"]

    def __init__(self, features: int, hidden: int, key: Key):
        keys = jax.random.split(key, 3)
        gates = 4 * hidden
        self.weight_input = random_weights(keys[0], hidden, features, gates)
        self.weight_hidden = random_weights(keys[1], hidden, hidden, gates)
        self.bias = random_weights(keys[2], hidden, gates)

    def __call__(self, inputs: Inputs, reverse: bool) -> Inputs:
        """Outputs in the order of the inputs, along modules or any other sequence."""
        # lax.scan runs over the first axis: the modules
        input_gates = jnp.moveaxis(inputs @ self.weight_input + self.bias, -2, 0)

        def unit(state, gates):
            hidden, cell = state
            split = jnp.split(gates + hidden @ self.weight_hidden, 4, axis=-1)
            input_gate, forget_gate, candidate, output_gate = split
            cell = jax.nn.sigmoid(forget_gate) * cell
            cell = cell + jax.nn.sigmoid(input_gate) * jnp.tanh(candidate)
            hidden = jax.nn.sigmoid(output_gate) * jnp.tanh(cell)
            return (hidden, cell), hidden

        zeros = jnp.zeros((*inputs.shape[:-2], len(self.weight_hidden)))
        _, outputs = jax.lax.scan(
            unit, (zeros, zeros), input_gates, reverse=reverse, unroll=UNROLLED
        )
        return jnp.moveaxis(outputs, 0, -2)


def random_weights(key: Key, hidden: int, *shape: int) -> Array:
    """Random weights, uniform within 1 / sqrt(hidden)."""
    bound = hidden**-0.5
    return jax.random.uniform(key, shape, minval=-bound, maxval=bound)


class BiLSTM(eqx.Module):
    """BiLSTM along the modules, not along time, with a linear head (fig. 5).

    Any number of modules and any batch axes will do.

    Example:
        >>> key = jax.random.key(0)
        >>> network = BiLSTM(features=3, outputs=6, layers=4, hidden=64, key=key)
        >>> network(jnp.zeros((3, 3))).shape
        (3, 6)
    """

    layers: list[tuple[Direction, Direction]]
    weight_head: Float[Array, "both_hidden outputs"]
    bias_head: Float[Array, " outputs"]

    def __init__(self, features: int, outputs: int, layers: int, hidden: int, key: Key):
        """Random weights for inputs and outputs of each module (`random_weights`).

        Args:
            features: inputs of each module.
            outputs: outputs of each module.
            layers: number of bidirectional layers.
            hidden: hidden states of each direction.
            key: for the weights.
        """
        head_key, *keys = jax.random.split(key, 2 * layers + 1)
        widths = [features] + [2 * hidden] * (layers - 1)
        self.layers = [
            (
                Direction(width, hidden, keys[2 * layer]),
                Direction(width, hidden, keys[2 * layer + 1]),
            )
            for layer, width in enumerate(widths)
        ]
        self.weight_head = random_weights(head_key, 2 * hidden, 2 * hidden, outputs)
        self.bias_head = jnp.zeros(outputs)

    def __call__(self, inputs: Inputs) -> Inputs:
        """Outputs of every module, from the inputs of all modules."""
        values = inputs
        for up, down in self.layers:
            values = jnp.concatenate(
                [up(values, reverse=False), down(values, reverse=True)], axis=-1
            )
        return values @ self.weight_head + self.bias_head


class C2S(eqx.Module):
    """NN_C2S, the forward model: from configurations to states [m, 1] (fig. 5A)."""

    network: BiLSTM
    configuration_scaling: Scaling
    state_scaling: Scaling

    def __call__(self, configurations: Configurations) -> States:
        """States that the configurations lead to, base frame."""
        scaled = self.configuration_scaling.forward(configurations)
        return self.state_scaling.back(self.network(scaled))


WORKSPACE_SHARE = 0.46 / 0.6
"""Unit of lengths in the losses, in arm lengths: half the workspace (sec. II-D)."""
MIN_DISTANCE = 1e-3  # units. Differs: 1 / d grows no further, so that it stays finite


def norm(vectors: Float[Array | np.ndarray, "*batch axis"]) -> Float[Array, "*batch"]:
    """Euclidean norm with gradient zero at zero."""
    squared = jnp.sum(jnp.asarray(vectors) ** 2, axis=-1)
    zero = squared == 0.0
    return jnp.where(zero, 0.0, jnp.sqrt(jnp.where(zero, 1.0, squared)))


def obstacle_loss(
    distances: Float[Array, "*obstacles"],
    thresholds: Float[Array | np.ndarray, "*#obstacles"],
) -> Float[Array, "*obstacles"]:
    """L_ob, eq. (5); obstacles with threshold zero do not exist."""
    inside = (distances <= thresholds) & (thresholds > 0.0)
    regular = inside & (distances > MIN_DISTANCE)
    repulsion = 1.0 / jnp.where(regular, distances, MIN_DISTANCE)
    return jnp.where(inside, repulsion, 0.0)


def cost(
    configurations: Configurations,
    last: Configurations,
    c2s: C2S,
    goal: Goal,
    unit: float,
) -> Float[Array, ""]:
    """The cost that planning minimizes, eq. (7).

    Add a term of your own here, or to a recipe (docs/guides/extending.md), such as
    `0.2 * jnp.sum(norm(configurations[1:] - configurations[:-1]))` for an even shape.

    Args:
        configurations: C, which is searched for.
        last: C_0. Differs: the last planned one, which is free of sensor noise.
        c2s: forward model.
        goal: desired states and weights mu; every module may have its own.
        unit: of lengths [m].
    """
    states = c2s(configurations)
    positions = states[:, POSITION]
    axes = states[:, AXIS]
    L_p = norm((positions - goal.positions) / unit)  # eq. (4), for each module
    L_o = norm(axes - goal.axes)
    distances = norm((positions[-1] - goal.obstacles) / unit)
    L_ob = obstacle_loss(distances, goal.thresholds / unit)  # eq. (5), each obstacle
    L_d = norm((configurations - last).reshape(-1))  # eq. (6)
    return (
        jnp.sum(goal.position_weights * L_p)
        + jnp.sum(goal.axis_weights * L_o)
        + goal.obstacle_weight * jnp.sum(L_ob)
        + goal.change_weight * L_d
    )


def unit_vectors(vectors: Configurations) -> Configurations:
    """The vectors at length one.

    Differs: a C that is free in the optimization leaves the data of NN_C2S.
    """
    return vectors / norm(vectors)[:, None]


def minimize(
    objective: Callable[[Array], Array],
    start: Configurations,
    project: Callable[[Array], Array] = unit_vectors,
    learning_rate: float = 0.02,
    iterations: int = 10,
) -> Configurations:
    """Minimize with Adam; numbers of sec. III-A. Each iteration ends with `project`."""
    optimizer = optax.adam(learning_rate)
    gradient = jax.grad(objective)

    def iterate(_, carry):
        point, state = carry
        updates, state = optimizer.update(gradient(point), state)
        return project(point + updates), state

    initial = start, optimizer.init(start)
    return jax.lax.fori_loop(0, iterations, iterate, initial)[0]


def plan(arm: ArmSpec, c2s: C2S, last: Configurations, goal: Goal) -> Configurations:
    """S2C: the next configurations, from the last planned ones."""
    unit = WORKSPACE_SHARE * arm.length
    planned = minimize(partial(cost, last=last, c2s=c2s, goal=goal, unit=unit), last)
    # Differs: bends are limited, and change by at most a step limit; with L_d alone, a
    # fixed target makes the tip jump 17 cm in one step.
    geometry = ArmGeometry.of(arm)
    bends = bends_from_configurations(planned)
    bends = limit_lengths(bends, _float32(geometry.planned_bends))
    last_bends = bends_from_configurations(last)
    step = limit_lengths(bends - last_bends, geometry.step_limit)
    return configurations_from_bends(last_bends + step)


# ---------------------------------------------------- III-B. Configuration control, C2A

HEADROOM = 1.25
"""Normalized actions are in units of the full action times this.

Differs: eq. (10) reaches 0.87 of the full bend in its worst direction, and its tanh
reaches one only at infinity; some bends in the data would be out of range.
"""


class History(NamedTuple):
    """Inputs of the controller from the past, latest first.

    Attributes:
        configurations: C_t to C_{t-3} as sensed, shape (*batch, modules, 4, 3).
        actions: A_{t-1} to A_{t-5}, normalized, shape (*batch, modules, 5, cables).
    """

    configurations: Float[Array, "*batch modules 4 3"]
    actions: Float[Array, "*batch modules 5 cables"]

    @classmethod
    def at_rest(cls, sensed: Float[Array, "modules 3"], cables: int) -> "History":
        """History of an arm that has been at rest; also before each episode."""
        configurations = jnp.repeat(sensed[:, None], CONFIGURATION_HISTORY, axis=1)
        return cls(configurations, jnp.zeros((len(sensed), ACTION_HISTORY, cables)))


def pushed(
    history: Float[Array, "modules ages features"],
    newest: Float[Array, "modules features"],
) -> Float[Array, "modules ages features"]:
    """The history with the newest row first and without the oldest."""
    return jnp.concatenate([newest[:, None], history[:, :-1]], axis=1)


def module_labels(modules: int) -> Float[Array, " modules"]:
    """Labels n_m = 2 (m - 1) / (n_sum - 1) - 1, eq. (9); zero for a single module."""
    if modules == 1:
        return jnp.zeros(1)
    return jnp.linspace(-1.0, 1.0, modules)


def controller_inputs(
    scaling: Scaling, desired: Configurations, history: History
) -> Inputs:
    """Inputs of each module in eq. (8): C_d,t+1; C_t to C_t-3; A_t-1 to A_t-5; n."""
    batch = desired.shape[:-1]
    labels = module_labels(batch[-1])[:, None]
    features = [
        scaling.forward(desired),
        scaling.forward(history.configurations).reshape(*batch, -1),
        history.actions.reshape(*batch, -1),
        jnp.broadcast_to(labels, (*batch, 1)),
    ]
    return jnp.concatenate(features, axis=-1)


def sum_and_range(raw: Float[Array, "*batch cables"]) -> Float[Array, "*batch cables"]:
    """The layer "sum and range" for three cables: sum zero, within [-1, 1]; eq. (10)."""
    squashed = jnp.tanh(raw)
    return (3.0 * squashed - jnp.sum(squashed, axis=-1, keepdims=True)) / 4.0


class C2A(eqx.Module):
    """NN_C2A, the controller (eq. (8), fig. 5B).

    Attributes:
        network: the biLSTM NN_C2A'.
        configuration_scaling: of desired and sensed configurations.
    """

    network: BiLSTM
    configuration_scaling: Scaling

    def __call__(self, desired: Configurations, history: History) -> Displacements:
        """Normalized actions that reach the desired configurations in one step."""
        inputs = controller_inputs(self.configuration_scaling, desired, history)
        actions = sum_and_range(self.network(inputs))
        return jnp.clip(actions, -1.0 / HEADROOM, 1.0 / HEADROOM)


def action_unit(arm: ArmSpec) -> Float[np.ndarray, "modules 1"]:
    """Displacement [m] of a normalized 1."""
    return HEADROOM * ArmGeometry.of(arm).action_scale[:, None]


# ------------------------------------------------------------- III-B. Training, table II

LEARNING_RATE = 1e-3
BATCH_SIZE = 64
C2S_SIZE = {"layers": 4, "hidden": 64}
C2A_SIZE = {"layers": 2, "hidden": 32}
EPOCHS = 100  # with early stopping, after:
PATIENCE = 15  # epochs without a better validation loss
HISTORY_NOISE = 0.05
"""Noise of past actions in training, normalized.

Differs: without it the controller learns to repeat its last action, and diverges.
"""


Loss = Callable[[Any, Any, Key | None], Float[Array, ""]]
"""Of a model on samples; with a key in training, without one in validation."""


class C2SSamples(NamedTuple):
    """Pairs of configurations and states; samples are the first axis."""

    configurations: Array
    states: Array


class C2ASamples(NamedTuple):
    """Windows of the data: from C_t+1 and the past to A_t; samples are the first axis."""

    desired: Array
    history: History
    actions: Array


def stretch(samples: int, part: str) -> slice:
    """Training, validation or test samples of an episode, in this order of time."""
    borders = np.rint(np.array([0.0, 0.70, 0.85, 1.0]) * samples).astype(int)
    number = ("training", "validation", "test").index(part)
    return slice(*borders[number : number + 2])


def c2s_samples(recording: Recording, part: str) -> C2SSamples:
    """Samples for NN_C2S."""
    chosen = stretch(recording.actions.shape[1], part)
    configurations = _merged(recording.configurations[:, chosen])
    return C2SSamples(configurations, _merged(recording.states[:, chosen]))


def c2a_samples(arm: ArmSpec, recording: Recording, part: str) -> C2ASamples:
    """Windows for NN_C2A, eq. (8); none crosses the border of a stretch or an episode."""
    # rest before each episode
    before = np.repeat(recording.configurations[:, :1], ACTION_HISTORY, axis=1)
    C = np.concatenate([before, recording.configurations], axis=1)
    A = recording.actions / action_unit(arm)
    A = np.concatenate([np.zeros_like(before), A], axis=1)
    chosen = stretch(recording.actions.shape[1], part)
    first = chosen.start + ACTION_HISTORY if chosen.start else 0
    t = np.arange(first, chosen.stop - 1) + ACTION_HISTORY
    past_C = [C[:, t - age] for age in range(CONFIGURATION_HISTORY)]
    past_A = [A[:, t - age] for age in range(1, ACTION_HISTORY + 1)]
    history = History(_merged(np.stack(past_C, -2)), _merged(np.stack(past_A, -2)))
    return C2ASamples(_merged(C[:, t + 1]), history, _merged(A[:, t]))


def c2s_loss(model: C2S, samples: C2SSamples, key: Key | None) -> Float[Array, ""]:
    """Mean squared error of the scaled states."""
    error = model(samples.configurations) - samples.states
    return jnp.mean((error / model.state_scaling.half_range) ** 2)


def c2a_loss(model: C2A, samples: C2ASamples, key: Key | None) -> Float[Array, ""]:
    """Mean squared error of the normalized actions; noisy history if there is a key."""
    history = samples.history
    if key is not None:
        noise = HISTORY_NOISE * jax.random.normal(key, history.actions.shape)
        history = history._replace(actions=history.actions + noise)
    return jnp.mean((model(samples.desired, history) - samples.actions) ** 2)


def fit(
    model: Any, loss: Loss, training: Any, validation: Any, key: Key, epochs: int
) -> Any:
    """Train `model.network` with Adam; returns the model of the best validation loss."""
    optimizer = optax.adam(LEARNING_RATE)
    samples = len(jax.tree.leaves(training)[0])
    batches = samples // BATCH_SIZE

    def loss_of(network, batch, key):
        return loss(replace(model, network=network), batch, key)

    @jax.jit
    def train_epoch(network, state, key, training, validation):
        def step(carry, inputs):
            network, state = carry
            rows, key = inputs
            batch = jax.tree.map(lambda values: values[rows], training)
            gradient = jax.grad(loss_of)(network, batch, key)
            updates, state = optimizer.update(gradient, state)
            return (optax.apply_updates(network, updates), state), None

        order_key, loss_key = jax.random.split(key)
        order = jax.random.permutation(order_key, samples)
        rows = order[: batches * BATCH_SIZE].reshape(batches, BATCH_SIZE)
        steps = rows, jax.random.split(loss_key, batches)
        (network, state), _ = jax.lax.scan(step, (network, state), steps)
        return network, state, loss_of(network, validation, None)

    network = best = model.network
    state = optimizer.init(network)
    losses: list[float] = []
    for epoch_key in jax.random.split(key, epochs):
        trained = train_epoch(network, state, epoch_key, training, validation)
        network, state, validation_loss = trained
        losses.append(float(validation_loss))
        if losses[-1] <= min(losses):
            best = network
        if len(losses) % 10 == 0:
            print(f"  epoch {len(losses)}: best validation loss {min(losses):.2e}")
        if len(losses) - 1 - int(np.argmin(losses)) >= PATIENCE:
            break
    return replace(model, network=best)


def train_c2s(recording: Recording, key: Key, epochs: int = EPOCHS) -> C2S:
    """NN_C2S, trained on a recording."""
    training = c2s_samples(recording, "training")
    validation = c2s_samples(recording, "validation")
    network_key, fit_key = jax.random.split(key)
    network = BiLSTM(3, 6, **C2S_SIZE, key=network_key)
    configuration_scaling = Scaling.of(np.asarray(training.configurations))
    state_scaling = Scaling.of_states(np.asarray(training.states))
    model = C2S(network, configuration_scaling, state_scaling)
    return fit(model, c2s_loss, training, validation, fit_key, epochs)


def train_c2a(
    arm: ArmSpec, recording: Recording, key: Key, epochs: int = EPOCHS
) -> C2A:
    """NN_C2A, trained on a recording."""
    training = c2a_samples(arm, recording, "training")
    validation = c2a_samples(arm, recording, "validation")
    network_key, fit_key = jax.random.split(key)
    features = 3 + 3 * CONFIGURATION_HISTORY + 3 * ACTION_HISTORY + 1
    network = BiLSTM(features, 3, **C2A_SIZE, key=network_key)
    model = C2A(network, Scaling.of(np.asarray(training.desired)))
    return fit(model, c2a_loss, training, validation, fit_key, epochs)


# ------------------------------------------------------------------ One control step


class Memory(NamedTuple):
    """What a control step needs from those before it.

    Attributes:
        planned: the last planned configurations, C_0 of eq. (6).
        history: inputs of the controller.
    """

    planned: Configurations
    history: History

    @classmethod
    def at_rest(cls, arm: ArmSpec, displacements: Displacements) -> "Memory":
        """Memory of an arm at rest, from its encoders [m]."""
        sensed = configurations_from_encoders(arm, displacements)
        return cls(sensed, History.at_rest(sensed, cables=3))


def control_step(
    arm: ArmSpec,
    c2s: C2S,
    c2a: C2A,
    memory: Memory,
    displacements: Displacements,
    goal: Goal,
) -> tuple[Displacements, Memory]:
    """Sense, plan and act (fig. 1C): from encoders and a goal to displacements [m]."""
    sensed = configurations_from_encoders(arm, displacements)
    planned = plan(arm, c2s, memory.planned, goal)
    configurations = pushed(memory.history.configurations, sensed)
    action = c2a(planned, History(configurations, memory.history.actions))
    actions = pushed(memory.history.actions, action)
    return action * action_unit(arm), Memory(planned, History(configurations, actions))


# ------------------------------------------------------- IV-B. Position control: a circle

APPROACH_TIME = 4.0  # s
ROUND_TIME = 16.0  # s


def circle(arm: ArmSpec) -> Float[np.ndarray, "steps 3"]:
    """Tip positions [m]: the arm bends along x, then its tip moves along a circle."""
    radius = 0.22 / 0.6 * arm.length
    drop = 0.06 / 0.6 * arm.length
    approach_steps = round(APPROACH_TIME * arm.control_rate)
    share = np.arange(1, approach_steps + 1) / approach_steps
    approach = [radius * share, 0.0 * share, arm.length - drop * share**2]
    round_steps = round(ROUND_TIME * arm.control_rate)
    angle = 2 * np.pi * np.arange(1, round_steps + 1) / round_steps
    height = np.full(round_steps, arm.length - drop)
    turn = [radius * np.cos(angle), radius * np.sin(angle), height]
    return np.concatenate([np.transpose(approach), np.transpose(turn)])


def follow(
    arm: ArmSpec,
    robot: "SimulatedRobot",
    c2s: C2S,
    c2a: C2A,
    path: Float[np.ndarray, "steps 3"],
) -> Float[np.ndarray, " steps"]:
    """Follow a path with a simulated arm; returns the distances of its tip [m].

    A real arm needs `runtime.Loop`, with its limits and its emergency stop.
    """
    step = eqx.filter_jit(partial(control_step, arm, c2s, c2a))
    memory = Memory.at_rest(arm, _float32(robot.open()["cables"]))
    errors = []
    for position in path:
        goal = Goal.of(arm.module_count).with_position(position)  # mu_p = 1, mu_d = 0.5
        action, memory = step(memory, _float32(robot.read()["cables"]), goal)
        robot.step(np.asarray(action, float))
        errors.append(np.linalg.norm(robot.read()["states"][-1, POSITION] - position))
    return np.array(errors)


def _float32(values: np.ndarray) -> Array:
    return jnp.asarray(values, dtype=jnp.float32)


def _merged(values: np.ndarray) -> Array:
    """Episodes and samples as one axis."""
    return _float32(values.reshape(-1, *values.shape[2:]))


def main(arguments: Sequence[str] | None = None) -> None:
    """Collect, train, and follow the circle."""
    from s2c2a.robots.simulation import SimulatedRobot

    description = "The paper in one file: collect, train, follow the circle."
    parser = argparse.ArgumentParser("python -m s2c2a.paper", description=description)
    parser.add_argument("--arm", default="twin_arm", help="name or file of an arm")
    parser.add_argument("--episodes", type=int, default=18, help="of 50 s at 10 Hz")
    parser.add_argument("--epochs", type=int, default=EPOCHS, help="at most")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args(arguments)
    arm = load_arm(options.arm)
    first_cable_angles(arm)  # refuses other arms
    make_robot = partial(SimulatedRobot, arm, "fast")
    c2s_key, c2a_key = jax.random.split(jax.random.key(options.seed))
    started = time.perf_counter()
    print(f"{options.episodes} episodes of staged babbling with {arm.name}")
    recording = collect(arm, make_robot, options.episodes, SAMPLES, options.seed)
    print(f"NN_C2S, from configurations to states: at most {options.epochs} epochs")
    c2s = train_c2s(recording, c2s_key, options.epochs)
    print(f"NN_C2A, from configurations to actions: at most {options.epochs} epochs")
    c2a = train_c2a(arm, recording, c2a_key, options.epochs)
    errors = 100 * follow(arm, make_robot(options.seed), c2s, c2a, circle(arm))
    print(
        f"circle: the tip was {errors.mean():.1f} +- {errors.std():.1f} cm from its "
        f"target, on average over {len(errors)} steps; "
        f"{time.perf_counter() - started:.0f} s in all"
    )


if __name__ == "__main__":
    main()
