"""What sensors say of how an arm bends, beside its motors' encoders: each against what is expected of it."""

from abc import abstractmethod
from collections.abc import Callable, Mapping
from typing import ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.kinematics import (
    bends_from_configurations,
    bends_from_states,
    configurations_from_bends,
)
from s2c2a.kinematics.chain import rotations_to, states_from_bends

SEEN_SPREAD = 0.003  # rad; of bends that something sees
LEVEL_SPREAD = 0.02  # rad; of what inertial sensors on a moving arm call down
# rad, and in a second; of accelerometers as they are sold
LEVEL_ZERO = 0.01
LEVEL_WANDER = 1e-4
FEW_PICTURES = 5.0  # a second
END_SPREAD = 0.05  # m; of ends that are seen late: slow, lest it follows the swing
MIN_TENSION = 0.05  # N
# rad; as if models were off by so much: friction hides most of what tensions tell
USUAL_BEND = 0.1
# rad, and of the arm's length
MAX_TURN = 0.14
MAX_WAY = 0.5
LATEST = 0.7  # s; what is older is not heard
NOTHING = np.zeros(0, np.float32)
Said = Mapping[str, Array]


class Shape(NamedTuple):
    """Where an arm is believed to be.

    Attributes:
        bends: of its modules [rad], shape (modules, 2).
        leans: of that, what nothing but leans is the reason of [rad], shape (modules,
            2).
        tensions: of its cables at rest without leans [N], shape (modules, cables); NaN
            where the model does not know.
        before: bends of the last steps, the newest first, as believed if something sees
            the swing, else at rest, shape (steps, modules, 2).
        states_before: states there, of the same steps, shape (steps, modules, 6).
        since: what bends at rest were found to differ by since then [rad], shape
            (steps, modules, 2).
        lagging: what the sense that looks lags by, as it said in the last step
            (`Sense.lagging`).
    """

    bends: Float[Array, "modules 2"]
    leans: Float[Array, "modules 2"]
    tensions: Float[Array, "modules cables"]
    before: Float[Array, "steps modules 2"]
    states_before: Float[Array, "steps modules 6"]
    since: Float[Array, "steps modules 2"]
    lagging: Array | np.ndarray = NOTHING


class Off(NamedTuple):
    """What a sensor says, against what was expected.

    Attributes:
        numbers: what was said less what was expected, shape (numbers,); not finite
            where nothing was said.
        slopes: of what is expected by bends, shape (numbers, n) with n = 2 modules.
        spread: standard deviation of what is left, shape (numbers,).
        most: that can be true from one control step to the next; what is further off is
            a fault.
        lagging: what it lags by from now on (`Sense.lagging`).
    """

    numbers: Float[Array, " numbers"]
    slopes: Float[Array, "numbers bends"]
    spread: Float[Array, " numbers"]
    most: float | Float[Array, ""]
    lagging: Array | np.ndarray = NOTHING


class Zeros(NamedTuple):
    """By how much a sensor's numbers are off whatever the arm does: nobody knows, and it wanders.

    Attributes:
        first: standard deviation when the arm is opened, shape (numbers,); no numbers,
            and it has none.
        wander: standard deviation of the change in a second, shape (numbers,).
    """

    first: Float[Array, " numbers"]
    wander: Float[Array, " numbers"]

    @classmethod
    def none(cls) -> "Zeros":
        """Of a sensor whose zero is known."""
        return cls(jnp.zeros(0), jnp.zeros(0))


class Sense(eqx.Module):
    """A sensor, or several alike.

    Attributes:
        name: the word for it.
        slow: whether it is held against where the arm would rest, and tells nothing of
            the swing.
        latest: how late it may tell [s].
    """

    name: ClassVar[str] = ""
    slow: ClassVar[bool] = False
    latest: ClassVar[float] = 0.0

    @property
    def late(self) -> float:
        """By how many control steps it tells late, as a rule."""
        return 0.0

    @property
    def zeros(self) -> Zeros:
        """What is to be found of it beside the arm."""
        return Zeros.none()

    def lagging(self, bends: Float[Array, "modules 2"]) -> Array | np.ndarray:
        """What it keeps in mind of an arm that begins at rest with such bends; nothing, if it does not lag."""
        return NOTHING

    @abstractmethod
    def off(self, said: Said, shape: Shape) -> Off:
        """What it says, against what was expected."""

    @abstractmethod
    def silent(self) -> dict[str, np.ndarray]:
        """What stands for its numbers where it says nothing: NaN, in their shapes."""


class SeenBends(Sense):
    """Something that sees how every module bends: motion capture of all ends at the loop's rate, or a simulation."""

    modules: int = eqx.field(static=True)
    name = "bends"

    def off(self, said: Said, shape: Shape) -> Off:
        """See `Sense`."""
        numbers = (
            bends_from_configurations(said["configurations"]) - shape.bends
        ).reshape(-1)
        return Off(
            numbers,
            jnp.eye(len(numbers)),
            jnp.full(len(numbers), SEEN_SPREAD),
            MAX_TURN,
        )

    def silent(self) -> dict[str, np.ndarray]:
        """See `Sense`."""
        return {"configurations": np.full((self.modules, 3), np.nan, np.float32)}


class Inclinations(Sense):
    """Which way is down at the end of every module, as inertial sensors tell it (`listening.Inclinometer`).

    Attributes:
        down: at the base, base frame.
        modules: how many.
    """

    down: Float[Array, "3"]
    modules: int = eqx.field(static=True)
    name = "imu"

    @property
    def zeros(self) -> Zeros:
        """See `Sense`."""
        return Zeros(
            jnp.full(3 * self.modules, LEVEL_ZERO),
            jnp.full(3 * self.modules, LEVEL_WANDER),
        )

    def off(self, said: Said, shape: Shape) -> Off:
        """See `Sense`."""
        expected, slopes = with_slopes(self._expected, shape.bends)
        numbers = said["inclinations"].reshape(-1) - expected
        return Off(numbers, slopes, jnp.full(expected.shape, LEVEL_SPREAD), MAX_TURN)

    def silent(self) -> dict[str, np.ndarray]:
        """See `Sense`."""
        return {"inclinations": np.full((self.modules, 3), np.nan, np.float32)}

    def _expected(self, bends: Float[Array, " bends"]) -> Float[Array, " numbers"]:
        down = self.down
        felt = []
        # an arm has few modules
        for turn in rotations_to(configurations_from_bends(bends.reshape(-1, 2))):
            down = turn.T @ down
            felt.append(down)
        return jnp.concatenate(felt)


class Tensions(Sense):
    """Tensions of the cables, as the motors' currents tell them.

    A taut cable tells by how much it is longer than its motor gave it, and so how its
    module bends, whatever bends it. Models know that no better than they know bends,
    and friction on its way hides the swing.

    Attributes:
        stiffness: by how much tensions rise with stretch over the cable radius [N/rad],
            shape (modules, 1).
        matrices: B, shape (modules, cables, 2).
        noise: of what currents tell [N].
    """

    stiffness: Float[Array, "modules 1"]
    matrices: Float[Array, "modules cables 2"]
    noise: float = eqx.field(static=True)
    name = "current"
    slow = True

    def off(self, said: Said, shape: Shape) -> Off:
        """See `Sense`."""
        modules = len(self.stiffness)
        more = self.stiffness * jnp.einsum("mnk,mk->mn", self.matrices, shape.leans)
        expected = jnp.maximum(shape.tensions + more, 0.0)
        taut = (said["tensions"] > 2.0 * self.noise) | (expected > 0.0)
        each = self.stiffness[..., None] * self.matrices * taut[..., None]
        slopes = jnp.einsum("mnk,ml->mnlk", each, jnp.eye(modules)).reshape(
            expected.size, -1
        )
        spread = jnp.broadcast_to(
            jnp.hypot(self.noise, self.stiffness * USUAL_BEND), expected.shape
        )
        return Off(
            (said["tensions"] - expected).reshape(-1),
            slopes,
            spread.reshape(-1),
            np.inf,
        )

    def silent(self) -> dict[str, np.ndarray]:
        """See `Sense`."""
        return {"tensions": np.full(self.matrices.shape[:2], np.nan, np.float32)}


class SeenEnds(Sense):
    """Where ends of modules are, as a camera or motion capture tells it: slowly, late, and not always.

    What it saw of the swing comes too late to be of use.

    Attributes:
        lengths: of the modules [m].
        period: of the control steps [s].
        delay: where a reading does not say how old a picture is [s].
        spread: of ends [m]; more where many are seen often, which tell no more of what
            is slow.
    """

    lengths: Float[Array, " modules"]
    period: float = eqx.field(static=True)
    delay: float = eqx.field(static=True)
    spread: float = eqx.field(static=True)
    name = "camera"
    slow = True
    latest = LATEST

    @property
    def late(self) -> float:
        """See `Sense`."""
        return self.delay / self.period

    def off(self, said: Said, shape: Shape) -> Off:
        """See `Sense`."""
        age = jnp.nan_to_num(said["camera_age"], nan=self.delay)
        place = jnp.clip(age / self.period, 0.0, len(shape.before) - 1.001)
        first = jnp.floor(place).astype(int)
        share = place - first
        past = (shape.before, shape.states_before, shape.since)
        bends, states, since = (
            (1.0 - share) * part[first] + share * part[first + 1] for part in past
        )
        expected, slopes = with_slopes(self._ends, bends + since)
        # what arcs do not have
        beside = states[:, :3].reshape(-1) - self._ends(
            bends_from_states(states).reshape(-1)
        )
        # it is read up to a step later
        known = (age >= 0.0) & (age <= self.latest + 1.01 * self.period)
        numbers = jnp.where(
            known, said["camera_positions"].reshape(-1) - expected - beside, jnp.nan
        )
        return Off(
            numbers,
            slopes,
            jnp.full(expected.shape, self.spread),
            MAX_WAY * jnp.sum(self.lengths),
        )

    def silent(self) -> dict[str, np.ndarray]:
        """See `Sense`."""
        return {
            "camera_positions": np.full((len(self.lengths), 3), np.nan, np.float32),
            "camera_age": np.full((), np.nan, np.float32),
        }

    def _ends(self, bends: Float[Array, " bends"]) -> Float[Array, " numbers"]:
        return states_from_bends(bends.reshape(-1, 2), self.lengths)[:, :3].reshape(-1)


def sensors_of(
    arm: ArmSpec, stiffnesses: Float[np.ndarray, " modules"] | None
) -> tuple[Sense, ...]:
    """All that an arm says of itself beside its encoders, by its description.

    Args:
        arm: the arm.
        stiffnesses: by how much tensions rise with the stretch of a cable [N/rad],
            where a model knows.
    """
    geometry = ArmGeometry.of(arm)
    modules = arm.module_count
    found: list[Sense] = []
    if arm.sensing == "true" or arm.sensors.bends:
        found.append(SeenBends(modules))
    if arm.sensors.imu is not None and any(arm.gravity_direction):
        found.append(
            Inclinations(jnp.asarray(arm.gravity_direction, jnp.float32), modules)
        )
    if arm.motor.current_noise is not None and stiffnesses is not None:
        noise = max(arm.motor.current_noise, MIN_TENSION) + arm.motor.current_friction
        each, matrices = (
            jnp.asarray(part, jnp.float32)
            for part in (stiffnesses, geometry.cable_matrices)
        )
        found.append(Tensions(each[:, None], matrices, noise))
    if (camera := arm.sensors.camera) is not None:
        told = max(1.0, camera.rate / FEW_PICTURES) * (
            arm.module_count if camera.sees == "ends" else 1
        )
        spread = END_SPREAD * told**0.5
        found.append(
            SeenEnds(
                jnp.asarray(geometry.lengths, jnp.float32),
                arm.control_period,
                camera.delay,
                spread,
            )
        )
    return tuple(found)


def with_slopes(
    expected: Callable[[Array], Array], bends: Float[Array, "modules 2"]
) -> tuple[Array, Array]:
    """What is expected, shape (numbers,), and its slopes by bends, shape (numbers, n) with n = 2 modules."""
    flat = bends.reshape(-1)
    return expected(flat), jax.jacfwd(expected)(flat)
