"""How an arm swings about where it would rest: the motion that a forward model of rest leaves out.

Bends b of all modules follow the bends s at which they would rest, with masses M,
damping D and stiffness K:

    M b'' + D b' + K (b - s) = 0

M and the part of K that is weight follow from the arm's description and from what hangs
at its tip, the rest of K and D from the description and two factors, which are found in
a recording.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.linalg import expm
from scipy.ndimage import uniform_filter1d
from scipy.optimize import minimize

from s2c2a.arm import ArmSpec
from s2c2a.arm.geometry import ArmGeometry
from s2c2a.kinematics.chain import states_from_bends
from s2c2a.models.trunk import TAUT, Trunk
from s2c2a.training.fit import Fixed

FIRST_DAMPING = 2.0  # of the nominal one
NEARLY = 1e-3  # rad; of a straight arm
SLOW = 1.3  # s; what is slower is no swing
# that are enough to see it
EPISODES = 8
SAMPLES = 600
FACTORS = np.log([[0.2, 0.3], [5.0, 20.0]])


class Swing(Fixed):
    """Two factors.

    Attributes:
        stiffness: over the nominal one, with half of the cables taut.
        damping: over the nominal one.
    """

    stiffness: Float[Array, ""]
    damping: Float[Array, ""]

    @classmethod
    def nominal(cls) -> "Swing":
        """As the description says."""
        return cls(jnp.asarray(1.0), jnp.asarray(FIRST_DAMPING))


class Motion(NamedTuple):
    """One control step of the swing, of bends and their rates: x' = A x + B s.

    Attributes:
        steps: A, shape (2 n, 2 n), with n = 2 modules.
        inputs: B, shape (2 n, n).
        masses: M [kg m2], shape (n, n).
        springs: K [N m], shape (n, n).
    """

    steps: Float[np.ndarray, "states states"]
    inputs: Float[np.ndarray, "states bends"]
    masses: Float[np.ndarray, "bends bends"]
    springs: Float[np.ndarray, "bends bends"]


class Body(NamedTuple):
    """What the swing of a nearly straight arm follows from.

    Attributes:
        levers: how ends move with bends [m], shape (modules, 3, n).
        rises: the same of second order, along gravity [m2/s2], shape (modules, n, n).
        weights: of modules [kg], shape (modules,).
        springs: nominal [N m], shape (n,).
        dampings: nominal [N m s], shape (n,).
    """

    levers: np.ndarray
    rises: np.ndarray
    weights: np.ndarray
    springs: np.ndarray
    dampings: np.ndarray

    @classmethod
    def of(cls, arm: ArmSpec) -> "Body":
        """From the description."""
        trunk = Trunk.of(arm)
        modules = arm.module_count

        levers, turns = _slopes_of_ends(jnp.full(2 * modules, NEARLY), trunk.lengths)
        rises = np.einsum("mcij,c->mij", np.asarray(turns), np.asarray(trunk.gravity))
        elastic = 1.0 / np.asarray(trunk.compliances)
        damping = elastic * np.array([module.damping_time for module in arm.modules])
        springs = elastic + TAUT * ArmGeometry.of(arm).cable_springs
        return cls(
            np.asarray(levers),
            rises,
            np.asarray(trunk.weights),
            np.repeat(springs, 2),
            np.repeat(damping, 2),
        )


@jax.jit
def _slopes_of_ends(
    bends: Float[Array, " n"], lengths: Float[Array, " modules"]
) -> tuple[Array, Array]:
    """First and second slopes of where modules' ends are, by bends."""

    def ends(bends: Array) -> Array:
        return states_from_bends(bends.reshape(-1, 2), lengths)[:, :3]

    return jax.jacfwd(ends)(bends), jax.jacfwd(jax.jacrev(ends))(bends)


def motion(body: Body, swing: Swing, load: float, period: float) -> Motion:
    """One control step.

    Args:
        body: that swings.
        swing: how.
        load: at the tip [kg].
        period: of the control steps [s].
    """
    weights = body.weights.copy()
    weights[-1] += load
    masses = np.einsum("mci,mcj,m->ij", body.levers, body.levers, weights)
    stiff = float(swing.stiffness) * body.springs
    sinking = np.einsum("mij,m->ij", body.rises, weights)
    springs = np.diag(stiff) - (sinking + sinking.T) / 2.0
    # it stands
    springs += max(
        0.0, 0.05 * stiff.min() - np.linalg.eigvalsh(springs).min()
    ) * np.eye(len(stiff))
    inverse = np.linalg.inv(masses)
    count = len(stiff)
    rates = np.zeros((3 * count, 3 * count))
    rates[:count, count : 2 * count] = np.eye(count)
    rates[count : 2 * count, :count] = -inverse @ springs
    rates[count : 2 * count, count : 2 * count] = -inverse @ np.diag(
        float(swing.damping) * body.dampings
    )
    rates[count : 2 * count, 2 * count :] = inverse @ springs
    whole = expm(rates * period)[: 2 * count]
    return Motion(whole[:, : 2 * count], whole[:, 2 * count :], masses, springs)


def modes(motion: Motion, period: float) -> Float[np.ndarray, "modes 2"]:
    """Frequencies [Hz] and damping ratios, slowest first."""
    poles = np.log(np.linalg.eigvals(motion.steps).astype(complex)) / period
    sizes = np.abs(poles)
    found = np.stack(
        [sizes / (2.0 * np.pi), -poles.real / np.maximum(sizes, 1e-12)], axis=-1
    )
    return found[np.argsort(sizes)][poles.imag[np.argsort(sizes)] >= 0]


def identified_swing(
    arm: ArmSpec,
    rests: Float[np.ndarray, "episodes samples modules 2"],
    bends: np.ndarray,
) -> tuple[Swing, tuple[float, float]]:
    """The factors under which the swing from rest to rest is most like what was recorded.

    Args:
        arm: that was recorded.
        rests: bends at which a forward model says it would rest [rad].
        bends: true ones [rad], the same shape; NaN where they are not known.

    Returns:
        The swing, and what is left of what is faster than slow [deg], root mean square:
        without and with it.
    """
    episodes = [
        one for one in range(len(rests)) if np.isfinite(bends[one, :SAMPLES]).all()
    ][:EPISODES]
    body = Body.of(arm)
    window = max(3, round(SLOW * arm.control_rate) | 1)
    nominal = Swing.nominal()
    if not episodes or rests.shape[1] < 2 * window:
        return nominal, (0.0, 0.0)
    told, seen = (np.asarray(part[episodes, :SAMPLES], float).reshape(len(episodes), -1, 2 * arm.module_count)
                  for part in (rests, bends))  # fmt: skip

    def left(moved: np.ndarray) -> float:
        off = moved - seen
        return float(
            np.sqrt(np.mean((off - uniform_filter1d(off, window, axis=1)) ** 2))
        )

    def cost(factors: np.ndarray) -> float:
        swing = Swing(*np.exp(np.clip(factors, *FACTORS)))
        return left(followed(motion(body, swing, 0.0, arm.control_period), told))

    begun = np.log([float(nominal.stiffness), float(nominal.damping)])
    found = minimize(
        cost,
        begun,
        method="Nelder-Mead",
        options={"maxfev": 80, "xatol": 0.02, "fatol": 1e-6},
    )
    if found.fun >= left(told):  # it does not show
        return nominal, (np.rad2deg(left(told)),) * 2
    swing = Swing(
        *(
            jnp.asarray(factor, jnp.float32)
            for factor in np.exp(np.clip(found.x, *FACTORS))
        )
    )
    return swing, (np.rad2deg(left(told)), np.rad2deg(float(found.fun)))


def followed(
    motion: Motion, rests: Float[np.ndarray, "episodes samples n"]
) -> Float[np.ndarray, "episodes samples n"]:
    """Bends that swing from rest to rest."""
    count = rests.shape[-1]
    state = np.zeros((len(rests), 2 * count))
    state[:, :count] = rests[:, 0]
    moved = [state[:, :count]]
    for now in range(1, rests.shape[1]):
        state = state @ motion.steps.T + rests[:, now] @ motion.inputs.T
        moved.append(state[:, :count])
    return np.stack(moved, axis=1)
