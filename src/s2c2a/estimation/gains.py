"""What the observer and the controller of the swing work with, by load: from the swing alone, before anything moves."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.arm import ArmSpec
from s2c2a.estimation.modal_model import Body, Motion, Swing, motion

LOADS = np.array([0.0, 0.1, 0.2, 0.4, 0.8, 1.6])  # of the arm's own mass
# of a bend that is asked for beside the plan, over one by which the arm is off, both as
# energy
EFFORT = 1.0
REACH = 0.8  # of a bend that is asked for, what the arm does
SIDEWAYS = 0.1  # along a straight arm forces move nothing
DOUBLINGS = 40
FADED = 1e-12


class Gains(NamedTuple):
    """Tables by load.

    Attributes:
        loads: [kg], shape (loads,).
        steps: A of each (`Motion`), shape (loads, states, states).
        inputs: B of each, shape (loads, states, bends).
        calming: what is asked for beside the plan, for bends and rates by which the arm
            is off, shape (loads, bends, states).
        caution: what spreads of sensors are multiplied by, so that the loop has its
            margins (`margins`), shape (loads,).
        forces: at the tip that would make modules lean so [N/rad], shape (3, bends).
    """

    loads: Float[Array, " loads"]
    steps: Float[Array, "loads states states"]
    inputs: Float[Array, "loads states bends"]
    calming: Float[Array, "loads bends states"]
    caution: Float[Array, " loads"]
    forces: Float[Array, "3 bends"]

    @classmethod
    def none(cls) -> "Gains":
        """Of an arm that nothing watches."""
        return cls(*(jnp.zeros(0) for _ in cls._fields))

    def at(self, load: Float[Array, ""]) -> tuple[Array, Array, Array, Array]:
        """A, B, gains and caution for a load, between those of the table."""
        place = jnp.interp(
            load, self.loads, jnp.arange(len(self.loads), dtype=jnp.float32)
        )
        first = jnp.clip(jnp.floor(place).astype(int), 0, len(self.loads) - 2)
        share = place - first
        steps, inputs, calming, caution = (
            (1.0 - share) * one[first] + share * one[first + 1] for one in self[1:5]
        )
        return steps, inputs, calming, caution


def gains_of(arm: ArmSpec, swing: Swing) -> Gains:
    """Of an arm that swings so."""
    body = Body.of(arm)
    loads = LOADS * body.weights.sum()
    motions = [motion(body, swing, float(load), arm.control_period) for load in loads]
    tables = (
        loads,
        *(
            np.stack(part)
            for part in zip(
                *((m.steps, m.inputs, calming(m)) for m in motions), strict=True
            )
        ),
    )
    forces = np.linalg.pinv(body.levers[-1].T, rcond=SIDEWAYS) * (
        float(swing.stiffness) * body.springs
    )
    return Gains(
        *(
            jnp.asarray(table, jnp.float32)
            for table in (*tables, np.ones(len(loads)), forces)
        )
    )


def calming(swinging: Motion) -> Float[np.ndarray, "bends states"]:
    """Gains that take most energy out of the swing for little that is asked for: a linear quadratic regulator."""
    count = len(swinging.masses)
    energy = np.zeros((2 * count, 2 * count))
    energy[:count, :count] = swinging.springs
    energy[count:, count:] = symmetric(swinging.masses)
    inputs = REACH * swinging.inputs
    effort = EFFORT * np.diag(np.diag(swinging.springs))
    cost = riccati(swinging.steps, inputs, symmetric(energy), effort)
    return np.linalg.solve(
        effort + inputs.T @ cost @ inputs, inputs.T @ cost @ swinging.steps
    )


def riccati(
    steps: Float[np.ndarray, "n n"],
    inputs: Float[np.ndarray, "n k"],
    cost: np.ndarray,
    effort: np.ndarray,
) -> Float[np.ndarray, "n n"]:
    """X = A' X A - A' X B (R + B' X B)^-1 B' X A + Q, for A, B, Q and R, by doubling (Chu et al. 2004).

    SciPy's solver, which sorts eigenvalues, gives up on arms of many modules.
    """
    count = len(steps)
    passed = steps
    moved = inputs @ np.linalg.solve(effort, inputs.T)
    found = cost
    for _ in range(DOUBLINGS):
        both = np.linalg.solve(
            np.eye(count) + moved @ found, np.concatenate([passed, moved], axis=1)
        )
        moved = symmetric(moved + passed @ both[:, count:] @ passed.T)
        found = symmetric(found + passed.T @ found @ both[:, :count])
        passed = passed @ both[:, :count]
        if np.abs(passed).max() < FADED:
            break
    return found


def symmetric(matrix: np.ndarray) -> np.ndarray:
    """Without what rounding left."""
    return (matrix + matrix.T) / 2.0
