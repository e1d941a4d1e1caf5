"""The paper in one file: from random motion to a circle, in the order of the paper.

Z. Chen et al., "A Versatile Neural Network Configuration Space Planning and Control
Strategy for Modular Soft Robot Arms", IEEE T-RO, 2025 (https://arxiv.org/abs/2410.03483).
Section and equation numbers are the paper's; "Differs" marks what the paper does not
state or what did not work as stated (docs/concepts/deviations.md).

    python -m s2c2a.paper

collects data with the simulated twin of the paper's arm, trains both networks and
follows the circle of sec. IV-B. The recipe `paper` of the toolbox computes the same, for
any arm, with checks of its inputs, a safe control loop and files.

Arrays may have batch axes before those that their types state.
"""

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple, Self

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Array, Float, PRNGKeyArray

from s2c2a.arm import ArmGeometry, ArmSpec, load_arm
from s2c2a.errors import TrainingError, counted
from s2c2a.execution.compilation import scan
from s2c2a.goals import Goal
from s2c2a.kinematics import (
    bends_from_configurations,
    configurations_from_bends,
    limit_lengths,
    norm,
)
from s2c2a.spaces import ACTION_HISTORY, AXIS, CONFIGURATION_HISTORY, POSITION

Numbers = Array | np.ndarray
C = Float[Array, "*batch modules 3"]
"""Configurations: direction of each module's end in the frame of its base."""
S = Float[Array, "*batch modules 6"]
"""States: position [m] and direction of each module's end in the arm's base frame."""
A = Float[Array, "*batch modules 3"]
"""Actions, or displacements that encoders measure [m]; normalized if a text says so."""
Features = Float[Array, "*batch modules features"]
Bends = Float[np.ndarray, "samples modules 2"]
RandomKey = PRNGKeyArray

# ---------------------------------------------------- II-C. Configuration estimation


def configurations_from_encoders(arm: ArmSpec, displacements: A) -> C:
    """C from the cable displacements that encoders measure [m]."""
    # eq. (1) holds but for noise and backlash: remove what all cables have in common
    a = displacements - displacements.mean(axis=-1, keepdims=True)
    difference = (a[..., 1] - a[..., 2]) / np.sqrt(3)
    radii = ArmGeometry.of(arm).cable_radii
    phi = jnp.sqrt(a[..., 0] ** 2 + difference**2) / radii  # eq. (2)
    theta = jnp.arctan2(-a[..., 0], difference)
    # the first cable of module II is not at 0 but at 60 deg (sec. II-A)
    first = np.deg2rad([module.cable_angles_deg[0] for module in arm.modules])
    azimuth = theta - np.pi / 2 + first
    o_x = jnp.sin(phi) * jnp.cos(azimuth)  # eq. (3)
    o_y = jnp.sin(phi) * jnp.sin(azimuth)
    return jnp.stack([o_x, o_y, jnp.cos(phi)], axis=-1)


# ------------------------------------------------------------- II-D. Data collection

SPEEDS = (0.03, 0.22)
"""Slowest and fastest motion of the data, in full bends a control step.

Differs: the paper states no speeds; a controller trained at one speed fails at others.
"""


class Recording(NamedTuple):
    """C as sensed, true S, and A as sent, each (episodes, samples, modules, ...)."""

    configurations: np.ndarray
    states: np.ndarray
    actions: np.ndarray


def disc_points(random: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    """Uniform random points in the unit disc."""
    radius = np.sqrt(random.uniform(size=shape))
    angle = random.uniform(0, 2 * np.pi, size=shape)
    return radius[..., None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def bend_path(samples: int, random: np.random.Generator, speeds=SPEEDS) -> np.ndarray:
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


def staged_shares(modules: int, progress: float) -> np.ndarray:
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
    shares: np.ndarray, samples: int, random: np.random.Generator, speeds=SPEEDS
) -> Bends:
    """Bends of all modules, in shares of the full bend: a mixture of random paths."""
    paths = [bend_path(samples, random, speeds) for _ in range(shares.shape[1])]
    mixed = np.einsum("mp,spk->smk", shares, np.stack(paths, axis=1))
    return mixed / np.maximum(np.linalg.norm(mixed, axis=-1, keepdims=True), 1.0)


def simulated(arm: ArmSpec, seed: int) -> Any:
    """A simulated arm. It is stepped directly; a real one needs `runtime.Loop`."""
    # the planner imports this file, and needs no simulation
    from s2c2a.robots.simulation import SimulatedRobot

    return SimulatedRobot(arm, "fast", seed)


def collect(arm: ArmSpec, episodes: int, samples: int, seed: int = 0) -> Recording:
    """Record staged babbling of a simulated arm; each episode starts at rest."""
    if min(episodes, samples) < 1:
        raise TrainingError(
            f"a recording of {episodes} x {samples} holds none; give some"
        )
    rows = []
    for episode in range(episodes):
        random = np.random.default_rng(np.random.SeedSequence([seed, episode]))
        shares = staged_shares(arm.module_count, episode / episodes)
        bends = mixed_bends(shares, samples, random)
        robot_seed = np.random.SeedSequence([seed, episode, 1]).generate_state(1)[0]
        robot = simulated(arm, int(robot_seed))
        robot.open()
        # babbling happens in bends; each has one action without a common displacement
        for action in ArmGeometry.of(arm).actions_at(bends):
            reading = robot.read()
            rows.append((reading["cables"], reading["states"], action))
            robot.step(action)
    displacements, states, actions = [
        np.reshape(column, (episodes, samples, arm.module_count, -1))
        for column in zip(*rows, strict=True)
    ]
    sensed = configurations_from_encoders(arm, jnp.asarray(displacements))
    return Recording(np.asarray(sensed), states, actions)


# ---------------------------------------------------- III-A. Configuration planning, S2C


class Scaling(eqx.Module):
    """Map of each feature from `center` +- `half_range` to [-1, 1]."""

    center: Float[Array, " features"]
    half_range: Float[Array, " features"]

    @classmethod
    def of(cls, values: Numbers) -> Self:
        """The map from the range of the values; a constant feature keeps its unit."""
        flat = np.reshape(values, (-1, values.shape[-1]))
        low = flat.min(axis=0)
        high = flat.max(axis=0)
        half_range = np.where(high > low, (high - low) / 2, 1.0)
        return cls(jnp.asarray((low + high) / 2), jnp.asarray(half_range))

    @classmethod
    def of_states(cls, states: Numbers) -> Self:
        """The map of states: one scale for x, y and z, none for axes; NaN is unknown.

        Differs: with one scale for each axis, obstacles would not stay spheres.
        """
        positions = np.reshape(states[..., POSITION], (-1, 3))
        low = np.nanmin(positions, axis=0)
        high = np.nanmax(positions, axis=0)
        half_width = (high - low).max() / 2
        center = jnp.concatenate([(low + high) / 2, jnp.zeros(3)])
        return cls(center, jnp.asarray([half_width] * 3 + [1.0] * 3))

    def forward(self, values: Array) -> Array:
        """To [-1, 1]."""
        return (values - self.center) / self.half_range

    def back(self, values: Array) -> Array:
        """From [-1, 1]."""
        return values * self.half_range + self.center


def random_weights(key: RandomKey, hidden: int, *shape: int) -> Array:
    """Random weights, uniform within 1 / sqrt(hidden)."""
    bound = hidden**-0.5
    return jax.random.uniform(key, shape, minval=-bound, maxval=bound)


class Direction(eqx.Module):
    """LSTM layer in one direction; gates are ordered input, forget, cell, output."""

    weight_input: Float[Array, "features gates"]
    weight_hidden: Float[Array, "hidden gates"]
    bias: Float[Array, " gates"]

    def __init__(self, features: int, hidden: int, key: RandomKey):
        keys = jax.random.split(key, 3)
        self.weight_input = random_weights(keys[0], hidden, features, 4 * hidden)
        self.weight_hidden = random_weights(keys[1], hidden, hidden, 4 * hidden)
        self.bias = random_weights(keys[2], hidden, 4 * hidden)

    def __call__(self, inputs: Features, reverse: bool) -> Features:
        """Outputs of each module, or of each element of any other sequence."""

        def unit(state, gates):
            recurrent, cell = state  # recurrent: from the module before to the gates
            taken, kept, candidate, shown = jnp.split(gates + recurrent, 4, axis=-1)
            cell = jax.nn.sigmoid(kept) * cell
            cell = cell + jax.nn.sigmoid(taken) * jnp.tanh(candidate)
            hidden = jax.nn.sigmoid(shown) * jnp.tanh(cell)
            return (hidden @ self.weight_hidden, cell), hidden

        gates = inputs @ self.weight_input + self.bias
        recurrent = jnp.zeros_like(gates[..., 0, :])
        cell = recurrent[..., : len(self.weight_hidden)]
        return scan(unit, (recurrent, cell), gates, reverse)


class BiLSTM(eqx.Module):
    """BiLSTM along the modules, not along time, with a linear head (fig. 5).

    Example:
        >>> key = jax.random.key(0)
        >>> network = BiLSTM(features=3, outputs=6, layers=4, hidden=64, key=key)
        >>> network(jnp.zeros((3, 3))).shape
        (3, 6)
    """

    layers: list[tuple[Direction, Direction]]
    weight_head: Float[Array, "both_hidden outputs"]
    bias_head: Float[Array, " outputs"]

    def __init__(
        self, features: int, outputs: int, layers: int, hidden: int, key: RandomKey
    ):
        """Random weights for features and outputs of each module."""
        head_key, *keys = jax.random.split(key, 2 * layers + 1)
        widths = [features] + [2 * hidden] * (layers - 1)
        up_keys = keys[0::2]
        down_keys = keys[1::2]
        self.layers = [
            (Direction(width, hidden, up_key), Direction(width, hidden, down_key))
            for width, up_key, down_key in zip(widths, up_keys, down_keys, strict=True)
        ]
        self.weight_head = random_weights(head_key, 2 * hidden, 2 * hidden, outputs)
        self.bias_head = jnp.zeros(outputs)

    def __call__(self, inputs: Features) -> Features:
        """Outputs of every module, from the inputs of all modules."""
        values = inputs
        for up, down in self.layers:
            both = [up(values, reverse=False), down(values, reverse=True)]
            values = jnp.concatenate(both, axis=-1)
        return values @ self.weight_head + self.bias_head


class C2S(eqx.Module):
    """NN_C2S, the forward model: from configurations to states (fig. 5A)."""

    network: BiLSTM
    configuration_scaling: Scaling
    state_scaling: Scaling

    def __call__(self, configurations: C) -> S:
        """S that the configurations lead to."""
        scaled = self.configuration_scaling.forward(configurations)
        return self.state_scaling.back(self.network(scaled))


WORKSPACE_SHARE = 0.46 / 0.6
"""Unit of lengths in the losses, in arm lengths: half the workspace (sec. II-D)."""
MIN_DISTANCE = 1e-3  # units. Differs: 1 / d grows no further, so that it stays finite


def obstacle_loss(distances: Array, thresholds: Numbers) -> Array:
    """L_ob, eq. (5); obstacles with threshold zero do not exist."""
    inside = (distances <= thresholds) & (thresholds > 0.0)
    # the inner `where` keeps the gradient finite where the outer one takes no notice
    regular = inside & (distances > MIN_DISTANCE)
    repulsion = 1.0 / jnp.where(regular, distances, MIN_DISTANCE)
    return jnp.where(inside, repulsion, 0.0)


def cost(configurations: C, last: C, c2s: C2S, goal: Goal, unit: float) -> Array:
    """The cost that planning minimizes, eq. (7).

    `last` is C_0. Differs: the last planned one, which is free of sensor noise. The goal
    holds desired states and weights mu of each module; `unit` is that of lengths [m].

    A term of your own is one more summand; for a recipe it is a class, as in
    examples/extending/own_term.py. For a tip above 0.5 m:
    `10.0 * jnp.maximum(0.5 - states[-1, 2], 0.0) / unit`.
    """
    states = c2s(configurations)
    L_p = norm((states[:, POSITION] - goal.positions) / unit)  # eq. (4)
    L_o = norm(states[:, AXIS] - goal.axes)
    distances = norm((states[-1, POSITION] - goal.obstacles) / unit)
    L_ob = obstacle_loss(distances, goal.thresholds / unit)
    L_d = norm((configurations - last).reshape(-1))  # eq. (6)
    return (
        jnp.sum(goal.position_weights * L_p)
        + jnp.sum(goal.axis_weights * L_o)
        + goal.obstacle_weight * jnp.sum(L_ob)
        + goal.change_weight * L_d
    )


def unit_vectors(vectors: C) -> C:
    """The vectors at length one.

    Differs: a C that is free in the optimization leaves the data of NN_C2S.
    """
    return vectors / norm(vectors)[:, None]


def minimize(
    objective: Callable, start: C, project=unit_vectors, rate=0.02, iterations=10
) -> C:
    """Minimize with Adam; numbers of sec. III-A. Each iteration ends with `project`."""
    optimizer = optax.adam(rate)

    def iterate(_, carry):
        point, state = carry
        updates, state = optimizer.update(jax.grad(objective)(point), state)
        return project(point + updates), state

    initial = start, optimizer.init(start)
    return jax.lax.fori_loop(0, iterations, iterate, initial)[0]


def plan(arm: ArmSpec, c2s: C2S, last: C, goal: Goal) -> C:
    """S2C: the next configurations, from the last planned ones."""
    unit = WORKSPACE_SHARE * arm.length
    planned = minimize(partial(cost, last=last, c2s=c2s, goal=goal, unit=unit), last)
    # Differs: bends are limited, and change by at most a step limit; with L_d alone, a
    # fixed target makes the tip jump 17 cm in one step.
    geometry = ArmGeometry.of(arm)
    bends = bends_from_configurations(planned)
    # bend limits as encoders see them, with lost motion; both limits are of the arm file
    bends = limit_lengths(bends, jnp.asarray(geometry.planned_bends))
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
    """C_t to C_{t-3} as sensed, and A_{t-1} to A_{t-5}, normalized."""

    configurations: Float[Array, "*batch modules 4 3"]
    actions: Float[Array, "*batch modules 5 cables"]

    @classmethod
    def at_rest(cls, sensed: C, cables: int = 3) -> "History":
        """History of an arm that has been at rest."""
        configurations = jnp.repeat(sensed[:, None], CONFIGURATION_HISTORY, axis=1)
        return cls(configurations, jnp.zeros((len(sensed), ACTION_HISTORY, cables)))


def pushed(history: Array, newest: Array) -> Array:
    """The history with the newest row first and without the oldest."""
    return jnp.concatenate([newest[:, None], history[:, :-1]], axis=1)


def module_labels(modules: int) -> Array:
    """Labels n_m = 2 (m - 1) / (n_sum - 1) - 1, eq. (9); zero for a single module."""
    return jnp.linspace(-1.0, 1.0, modules) if modules > 1 else jnp.zeros(1)


def controller_inputs(scaling: Scaling, desired: C, history: History) -> Features:
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


def sum_and_range(raw: Array) -> Array:
    """The layer "sum and range" for three cables: sum zero, within [-1, 1]; eq. (10)."""
    squashed = jnp.tanh(raw)
    return (3.0 * squashed - jnp.sum(squashed, axis=-1, keepdims=True)) / 4.0


class C2A(eqx.Module):
    """NN_C2A, the controller (eq. (8), fig. 5B); `network` is the biLSTM NN_C2A'."""

    network: BiLSTM
    configuration_scaling: Scaling

    def __call__(self, desired: C, history: History) -> A:
        """Normalized actions that reach the desired configurations in one step."""
        inputs = controller_inputs(self.configuration_scaling, desired, history)
        actions = sum_and_range(self.network(inputs))
        # Differs: beyond the full action a cable stops, and the sum is no longer zero
        full = 1.0 / HEADROOM
        return jnp.clip(actions, -full, full)


def action_unit(arm: ArmSpec) -> np.ndarray:
    """Displacement [m] of a normalized 1, shape (modules, 1)."""
    return HEADROOM * ArmGeometry.of(arm).action_scale[:, None]


# ------------------------------------------------------------- III-B. Training, table II

# of Adam, and of its batches and epochs
LEARNING_RATE = 1e-3
BATCH_SIZE = 64
EPOCHS = 100  # the weights of the best validation loss are kept
C2S_SIZE = {"layers": 4, "hidden": 64}
C2A_SIZE = {"layers": 2, "hidden": 32}
HISTORY_NOISE = 0.05
"""Noise of past actions in training, normalized.

Differs: without it the controller learns to repeat its last action, and diverges.
"""


class Samples(NamedTuple):
    """Inputs and targets of a network; samples are the first axis of all arrays."""

    inputs: Any
    targets: Array


# of each episode, with a gap, since neighbors in time are alike; the rest is for tests
PARTS = {"training": (0.0, 0.65), "validation": (0.70, 0.85)}


def stretch(samples: int, part: str) -> slice:
    """Steps of an episode that belong to a part of the data."""
    start, end = PARTS[part]
    return slice(round(start * samples), round(end * samples))


def merged(values: np.ndarray) -> Array:
    """Episodes and samples as one axis."""
    return jnp.asarray(values.reshape(-1, *values.shape[2:]))


def c2s_samples(recording: Recording, part: str) -> Samples:
    """Pairs of C and S."""
    chosen = stretch(recording.actions.shape[1], part)
    configurations = merged(recording.configurations[:, chosen])
    return Samples(configurations, merged(recording.states[:, chosen]))


def c2a_samples(arm: ArmSpec, recording: Recording, part: str) -> Samples:
    """Windows of C_t+1, the past, and A_t; none crosses the border of a stretch."""
    # before each episode the arm rests
    before = np.repeat(recording.configurations[:, :1], ACTION_HISTORY, axis=1)
    sensed = np.concatenate([before, recording.configurations], axis=1)
    actions = recording.actions / action_unit(arm)
    actions = np.concatenate([np.zeros_like(before), actions], axis=1)
    chosen = stretch(recording.actions.shape[1], part)
    # the past of the first window is in the same stretch
    first = chosen.start + ACTION_HISTORY if chosen.start else 0
    t = np.arange(first, chosen.stop - 1) + ACTION_HISTORY
    past_sensed = [sensed[:, t - age] for age in range(CONFIGURATION_HISTORY)]
    past_actions = [actions[:, t - 1 - age] for age in range(ACTION_HISTORY)]
    history = History(
        merged(np.stack(past_sensed, axis=-2)), merged(np.stack(past_actions, axis=-2))
    )
    return Samples((merged(sensed[:, t + 1]), history), merged(actions[:, t]))


def c2s_loss(model: C2S, samples: Samples, key: RandomKey | None) -> Array:
    """Mean squared error of the scaled states."""
    error = model(samples.inputs) - samples.targets
    return jnp.mean((error / model.state_scaling.half_range) ** 2)


def c2a_loss(model: C2A, samples: Samples, key: RandomKey | None) -> Array:
    """Mean squared error of the normalized actions; a key makes the history noisy."""
    desired, history = samples.inputs
    if key is not None:
        noise = HISTORY_NOISE * jax.random.normal(key, history.actions.shape)
        history = history._replace(actions=history.actions + noise)
    return jnp.mean((model(desired, history) - samples.targets) ** 2)


def fit(model: Any, loss: Callable, samples: list, key: RandomKey, epochs: int) -> Any:
    """Train `model.network` with Adam; returns the model of the best validation loss."""
    training, validation = samples
    optimizer = optax.adam(LEARNING_RATE)
    count = len(training.targets)
    batches = count // BATCH_SIZE
    if not (batches and len(validation.targets)):
        raise TrainingError(
            f"{counted(count, 'training sample')}, fewer than a batch of {BATCH_SIZE}, or "
            "none for validation; give more"
        )

    def loss_of(network, samples, key):
        return loss(replace(model, network=network), samples, key)

    def step(carry, inputs):
        network, state = carry
        rows, key = inputs
        batch = jax.tree.map(lambda values: values[rows], training)
        gradient = jax.grad(loss_of)(network, batch, key)
        updates, state = optimizer.update(gradient, state)
        return (optax.apply_updates(network, updates), state), None

    @jax.jit
    def train_epoch(network, state, key):
        order_key, loss_key = jax.random.split(key)
        order = jax.random.permutation(order_key, count)[: batches * BATCH_SIZE]
        steps = order.reshape(batches, -1), jax.random.split(loss_key, batches)
        (network, state), _ = jax.lax.scan(step, (network, state), steps)
        return network, state, loss_of(network, validation, None)

    network = best = model.network
    state = optimizer.init(network)
    least = np.inf
    for epoch, epoch_key in enumerate(jax.random.split(key, epochs), start=1):
        network, state, validation_loss = train_epoch(network, state, epoch_key)
        if validation_loss < least:
            best = network
            least = float(validation_loss)
        if epoch % 10 == 0:
            print(f"  epoch {epoch} of {epochs}: best validation loss {least:.2e}")
    return replace(model, network=best)


def train_c2s(recording: Recording, key: RandomKey, epochs: int) -> C2S:
    """NN_C2S, trained on a recording."""
    samples = [c2s_samples(recording, part) for part in PARTS]
    network_key, fit_key = jax.random.split(key)
    network = BiLSTM(3, 6, **C2S_SIZE, key=network_key)
    inputs, states = samples[0]
    model = C2S(network, Scaling.of(inputs), Scaling.of_states(states))
    return fit(model, c2s_loss, samples, fit_key, epochs)


def train_c2a(arm: ArmSpec, recording: Recording, key: RandomKey, epochs: int) -> C2A:
    """NN_C2A, trained on a recording."""
    samples = [c2a_samples(arm, recording, part) for part in PARTS]
    network_key, fit_key = jax.random.split(key)
    features = 3 + 3 * CONFIGURATION_HISTORY + 3 * ACTION_HISTORY + 1
    network = BiLSTM(features, 3, **C2A_SIZE, key=network_key)
    desired, _ = samples[0].inputs
    return fit(C2A(network, Scaling.of(desired)), c2a_loss, samples, fit_key, epochs)


# ------------------------------------------------------------------ One control step


def control_step(
    arm: ArmSpec, c2s: C2S, c2a: C2A, last: C, history: History, encoders: A, goal: Goal
) -> tuple[A, C, History]:
    """Sense, plan and act (fig. 1C).

    From the last plan, the past, encoders and a goal to the action [m], the next plan,
    and the past of the next step.
    """
    sensed = configurations_from_encoders(arm, encoders)
    planned = plan(arm, c2s, last, goal)
    configurations = pushed(history.configurations, sensed)
    action = c2a(planned, History(configurations, history.actions))
    actions = pushed(history.actions, action)
    return action * action_unit(arm), planned, History(configurations, actions)


# ------------------------------------------------------- IV-B. Position control: a circle


def circle(arm: ArmSpec) -> np.ndarray:
    """Tip positions [m]: 4 s of bending along x, then a round of 16 s."""
    radius = 0.22 / 0.6 * arm.length
    drop = 0.06 / 0.6 * arm.length
    t = np.arange(1, 20 * arm.control_rate + 1) / arm.control_rate
    share = np.minimum(t / 4, 1)  # of the approach
    angle = 2 * np.pi * np.maximum(t - 4, 0) / 16
    x = radius * share * np.cos(angle)
    y = radius * share * np.sin(angle)
    return np.stack([x, y, arm.length - drop * share**2], axis=-1)


def follow(
    arm: ArmSpec, c2s: C2S, c2a: C2A, path: np.ndarray, seed: int = 0
) -> np.ndarray:
    """Follow a path with a simulated arm; returns the distances of its tip [m]."""
    robot = simulated(arm, seed)
    step = eqx.filter_jit(partial(control_step, arm, c2s, c2a))
    planned = configurations_from_encoders(arm, jnp.asarray(robot.open()["cables"]))
    history = History.at_rest(planned)
    errors = []
    for position in path:
        goal = Goal.of(arm.module_count).with_position(position)  # mu_p = 1, mu_d = 0.5
        encoders = jnp.asarray(robot.read()["cables"])
        action, planned, history = step(planned, history, encoders, goal)
        robot.step(np.asarray(action, float))
        errors.append(np.linalg.norm(robot.read()["states"][-1, POSITION] - position))
    return np.array(errors)


def main(episodes=18, samples=500, epochs=EPOCHS, seed=0) -> None:
    """Collect, train, and follow the circle; by default with the paper's 9000 samples."""
    started = time.perf_counter()
    arm = load_arm("twin_arm")
    c2s_key, c2a_key = jax.random.split(jax.random.key(seed))
    print(f"{counted(episodes, 'episode')} of staged babbling with {arm.name}")
    recording = collect(arm, episodes, samples, seed)
    print("NN_C2S, from configurations to states")
    c2s = train_c2s(recording, c2s_key, epochs)
    print("NN_C2A, from configurations to actions")
    c2a = train_c2a(arm, recording, c2a_key, epochs)
    errors = 100 * follow(arm, c2s, c2a, circle(arm), seed)
    print(f"tip: {errors.mean():.1f} +- {errors.std():.1f} cm from the circle")
    print(f"{time.perf_counter() - started:.0f} s in all")


if __name__ == "__main__":
    main()
