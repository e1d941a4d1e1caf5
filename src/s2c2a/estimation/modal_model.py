"""Modal model: vibration of an arm about its equilibrium.

Bends b of all modules follow their equilibrium bends s, with mass M, damping D and
stiffness K:

    M b'' + D b' + K (b - s) = 0

M and the gravity part of K follow from the arm's description and the payload. The rest
of K and D follow from the description and two factors, which are identified from a
recording.
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
import scipy
from jaxtyping import Array, Float

from s2c2a.arm import ArmSpec
from s2c2a.arm.geometry import ArmGeometry
from s2c2a.kinematics.bends import Scalar
from s2c2a.models.trunk import TAUT, Trunk
from s2c2a.training.fit import Fixed

NOMINAL_DAMPING = 2.0  # of the described one, where nothing was identified
MIN_STIFFNESS = 0.05
"""Of the softest module: a heavy payload must not make K indefinite."""
SLOWEST = 1.3  # s; slower errors are not vibration
MAX_EPISODES = 8  # used for identification
MAX_SAMPLES = 600  # of each
# of stiffness and damping: an arm file is wrong by no more than such factors
LOG_FACTOR_LIMITS = np.log([[0.2, 0.3], [5.0, 20.0]])
TABLE_PAYLOADS = np.array([0.0, 0.1, 0.2, 0.4, 0.8, 1.6])  # of the arm's mass
AXIAL_CUTOFF = 0.1  # of the largest: along a straight arm, forces bend nothing


class ModalFactors(Fixed):
    """Stiffness and damping over their nominal values.

    Attributes:
        stiffness: over the nominal one, with half of the cables taut.
        damping: over the nominal one.
    """

    stiffness: Scalar
    damping: Scalar

    @classmethod
    def nominal(cls) -> "ModalFactors":
        """Nominal factors, without identification."""
        return cls(jnp.asarray(1.0), jnp.asarray(NOMINAL_DAMPING))


class ModalStep(NamedTuple):
    """One control step of bends and their rates: x' = A x + B s.

    Attributes:
        transition: A, shape (2 n, 2 n), with n = 2 modules.
        input: B, shape (2 n, n).
    """

    transition: Float[np.ndarray, "states states"]
    input: Float[np.ndarray, "states bends"]


class LinearizedArm(NamedTuple):
    """Quantities of a nearly straight arm that its vibration depends on.

    Attributes:
        jacobians: of the modules' ends by the bends [m], shape (modules, 3, n).
        heights: second derivatives of the ends along gravity [m2/s2], shape (modules,
            n, n).
        masses: of the modules [kg], shape (modules,).
        stiffnesses: nominal [N m], shape (n,).
        dampings: nominal [N m s], shape (n,).
    """

    jacobians: np.ndarray
    heights: np.ndarray
    masses: np.ndarray
    stiffnesses: np.ndarray
    dampings: np.ndarray

    @classmethod
    def of(cls, arm: ArmSpec) -> "LinearizedArm":
        """Linearize the arm of an arm file."""
        trunk = Trunk.of(arm)
        jacobians, heights = _end_derivatives(np.asarray(trunk.lengths, float))
        elastic = 1.0 / np.asarray(trunk.compliances)
        damping_times = np.array([module.damping_time for module in arm.modules])
        cables = TAUT * ArmGeometry.of(arm).cable_springs
        return cls(
            jacobians=jacobians,
            heights=arm.gravity[2] * heights,
            masses=np.asarray(trunk.weights),
            stiffnesses=np.repeat(elastic + cables, 2),
            dampings=np.repeat(elastic * damping_times, 2),
        )

    def with_payload(self, payload: float) -> "LinearizedArm":
        """The same with a mass at the tip [kg]."""
        masses = self.masses.copy()
        masses[-1] += payload
        return self._replace(masses=masses)


def _end_derivatives(
    lengths: Float[np.ndarray, " modules"],
) -> tuple[Float[np.ndarray, "modules 3 n"], Float[np.ndarray, "modules n n"]]:
    """Slopes of the ends' positions, and curvatures of their heights, of a straight arm.

    The axis at arc length s turns by t(s), the bends so far: an end moves sideways by
    the integral of t, and down by that of t^2 / 2.
    """
    modules = len(lengths)
    own = np.eye(modules)
    middle = np.tril(np.ones((modules, modules)), -1) + own / 2.0  # bends up to there
    squares = np.einsum("mi,mj->mij", middle, middle)
    squares += np.einsum("mi,mj->mij", own, own) / 12.0
    below = np.tril(lengths * np.ones((modules, modules)))  # lengths up to every end
    sideways = np.einsum("ei,ca->ecia", below @ middle, np.eye(3)[:, :2])
    heights = -np.einsum("em,mij,ab->eiajb", below, squares, np.eye(2))
    return sideways.reshape(modules, 3, -1), heights.reshape(modules, 2 * modules, -1)


def modal_step(arm: LinearizedArm, factors: ModalFactors, period: float) -> ModalStep:
    """Discretize the modal model.

    Args:
        arm: with its payload.
        factors: of stiffness and damping.
        period: of the control steps [s].
    """
    bends = len(arm.stiffnesses)
    inverse_mass = np.linalg.inv(_masses(arm))
    stiffness = _stiffness(arm, float(factors.stiffness))
    damping = np.diag(float(factors.damping) * arm.dampings)
    # d/dt [b, b', s] = rates [b, b', s], s constant within a control step
    rates = np.zeros((3 * bends, 3 * bends))
    rates[:bends, bends : 2 * bends] = np.eye(bends)
    rates[bends : 2 * bends, :bends] = -inverse_mass @ stiffness
    rates[bends : 2 * bends, bends : 2 * bends] = -inverse_mass @ damping
    rates[bends : 2 * bends, 2 * bends :] = inverse_mass @ stiffness
    step = scipy.linalg.expm(rates * period)[: 2 * bends]
    return ModalStep(step[:, : 2 * bends], step[:, 2 * bends :])


def _masses(arm: LinearizedArm) -> Float[np.ndarray, "bends bends"]:
    return np.einsum("mci,mcj,m->ij", arm.jacobians, arm.jacobians, arm.masses)


def _stiffness(arm: LinearizedArm, factor: float) -> Float[np.ndarray, "bends bends"]:
    """Stiffness of modules and cables less that of gravity, positive definite."""
    own = factor * arm.stiffnesses
    gravity = np.einsum("mij,m->ij", arm.heights, arm.masses)
    stiffness = np.diag(own) - (gravity + gravity.T) / 2.0
    softest = np.linalg.eigvalsh(stiffness).min()
    missing = max(0.0, MIN_STIFFNESS * own.min() - softest)
    return stiffness + missing * np.eye(len(own))


class ModalTable(NamedTuple):
    """The modal model over the payload, and forces for bend biases.

    Attributes:
        payloads: of the table's rows [kg], shape (payloads,).
        transitions: A of each, shape (payloads, states, states).
        inputs: B of each, shape (payloads, states, bends).
        forces: at the tip that would cause bend biases [N/rad], shape (3, bends).
    """

    payloads: Float[Array, " payloads"]
    transitions: Float[Array, "payloads states states"]
    inputs: Float[Array, "payloads states bends"]
    forces: Float[Array, "3 bends"]

    @classmethod
    def of(cls, arm: ArmSpec, factors: ModalFactors) -> "ModalTable":
        """The table of an arm with these factors."""
        linearized = LinearizedArm.of(arm)
        payloads = TABLE_PAYLOADS * linearized.masses.sum()
        steps = [
            modal_step(linearized.with_payload(payload), factors, arm.control_period)
            for payload in payloads
        ]
        tip = linearized.jacobians[-1]
        stiffnesses = float(factors.stiffness) * linearized.stiffnesses
        forces = np.linalg.pinv(tip.T, rcond=AXIAL_CUTOFF) * stiffnesses
        parts = payloads, *map(np.stack, zip(*steps, strict=True)), forces
        return cls(*(jnp.asarray(part, jnp.float32) for part in parts))

    def at(self, payload: Scalar) -> tuple[Array, Array]:
        """A and B for a payload [kg], interpolated."""
        rows = jnp.arange(len(self.payloads), dtype=jnp.float32)
        place = jnp.interp(payload, self.payloads, rows)
        row = jnp.clip(jnp.floor(place).astype(int), 0, len(self.payloads) - 2)
        share = place - row

        def interpolated(table: Array) -> Array:
            return (1.0 - share) * table[row] + share * table[row + 1]

        return interpolated(self.transitions), interpolated(self.inputs)


def first_mode(
    arm: ArmSpec, factors: ModalFactors
) -> tuple[Float[np.ndarray, " payloads"], Float[np.ndarray, " payloads"]]:
    """Payloads at the tip [kg], and the frequencies of the slowest mode [rad/s]."""
    linearized = LinearizedArm.of(arm)
    payloads = TABLE_PAYLOADS * linearized.masses.sum()
    stiffness = float(factors.stiffness)
    # the stiffness is never singular; masses of very unequal modules may be
    squares = [
        scipy.linalg.eigvalsh(_masses(loaded), _stiffness(loaded, stiffness))[-1]
        for loaded in map(linearized.with_payload, payloads)
    ]
    return payloads, 1.0 / np.sqrt(squares)


def identify_modal_factors(
    arm: ArmSpec,
    equilibria: Float[np.ndarray, "episodes samples modules 2"],
    bends: Float[np.ndarray, "episodes samples modules 2"],
) -> tuple[ModalFactors, float, float]:
    """Find the factors with which the simulated vibration fits a recording best.

    Args:
        arm: that was recorded.
        equilibria: bends at rest that the forward model predicts [rad].
        bends: true bends [rad]; NaN where unknown.

    Returns:
        The factors; the fast part of the error without and with the modal model, root
        mean square [deg]. Nominal factors without a complete episode that is long
        enough.
    """
    nominal = ModalFactors.nominal()
    window = max(3, round(SLOWEST * arm.control_rate) | 1)
    complete = np.isfinite(bends[:, :MAX_SAMPLES]).all(axis=(1, 2, 3))
    episodes = np.flatnonzero(complete)[:MAX_EPISODES]
    if not len(episodes) or equilibria.shape[1] < 2 * window:
        return nominal, 0.0, 0.0
    shape = (len(episodes), -1, 2 * arm.module_count)
    inputs = np.asarray(equilibria[episodes, :MAX_SAMPLES], float).reshape(shape)
    targets = np.asarray(bends[episodes, :MAX_SAMPLES], float).reshape(shape)
    linearized = LinearizedArm.of(arm)

    def fast_error(predicted: np.ndarray) -> float:
        errors = predicted - targets
        fast = errors - scipy.ndimage.uniform_filter1d(errors, window, axis=1)
        return float(np.sqrt(np.mean(fast**2)))

    def cost(log_factors: np.ndarray) -> float:
        factors = _factors(log_factors)
        step = modal_step(linearized, factors, arm.control_period)
        return fast_error(simulate(step, inputs))

    start = np.log([float(nominal.stiffness), float(nominal.damping)])
    options = {"maxfev": 80, "xatol": 0.02, "fatol": 1e-6}
    result = scipy.optimize.minimize(cost, start, method="Nelder-Mead", options=options)
    without = fast_error(inputs)
    return _factors(result.x), np.rad2deg(without), np.rad2deg(float(result.fun))


def _factors(log_factors: np.ndarray) -> ModalFactors:
    stiffness, damping = np.exp(np.clip(log_factors, *LOG_FACTOR_LIMITS))
    return ModalFactors(
        jnp.asarray(stiffness, jnp.float32), jnp.asarray(damping, jnp.float32)
    )


def simulate(
    step: ModalStep, equilibria: Float[np.ndarray, "episodes samples n"]
) -> Float[np.ndarray, "episodes samples n"]:
    """Bends that follow their equilibria and vibrate."""
    bends = equilibria.shape[-1]
    state = np.zeros((len(equilibria), 2 * bends))
    state[:, :bends] = equilibria[:, 0]
    results = [state[:, :bends]]
    for sample in range(1, equilibria.shape[1]):
        state = state @ step.transition.T + equilibria[:, sample] @ step.input.T
        results.append(state[:, :bends])
    return np.stack(results, axis=1)
