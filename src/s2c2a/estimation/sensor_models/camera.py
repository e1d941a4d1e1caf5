"""Positions of the modules' ends from a camera or motion capture."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.arm.sensors import MAX_DELAY, Camera
from s2c2a.estimation.sensor_models.base import (
    ExpectedState,
    Innovation,
    Measurements,
    SensorModel,
    interpolated,
    with_jacobian,
)
from s2c2a.kinematics import bends_from_states
from s2c2a.kinematics.chain import states_from_bends
from s2c2a.models.forward_model import ForwardModel

POSITION_STD = 0.05  # m; large, so that the estimate does not follow the vibration
# of the arm's length: a change of the residual in some seconds, by drift, wrong latency or
# a jump, and a distance beyond what an arm reaches, in a picture of something else
MAX_CHANGE = 0.06


class CameraSensor(SensorModel):
    """Measures end positions, at a low rate, late, and with missing pictures.

    Attributes:
        model: forward model; knows the frame of the pictures.
        lengths: of the modules [m].
        period: of the control steps [s].
        delay: age of a picture if the reading does not give it [s].
        std: standard deviation of a position [m]; larger where many are measured often,
            since they share their slow errors.
        rate: of the pictures [Hz].
    """

    model: ForwardModel
    lengths: Float[Array, " modules"]
    period: float = eqx.field(static=True)
    delay: float = eqx.field(static=True)
    std: float = eqx.field(static=True)
    rate: float = eqx.field(static=True)
    name = "camera"
    measures_equilibrium = True
    sees_ends = True
    max_delay = MAX_DELAY

    @classmethod
    def of(cls, arm: ArmSpec, model: ForwardModel) -> "CameraSensor | None":
        camera = arm.sensors.camera
        if camera is None:
            return None
        ends = arm.module_count if camera.sees == "ends" else 1
        # more frequent pictures weigh less each
        weight = ends * max(1.0, camera.rate / Camera().rate)
        lengths = jnp.asarray(ArmGeometry.of(arm).lengths, jnp.float32)
        std = POSITION_STD * weight**0.5
        return cls(model, lengths, arm.control_period, camera.delay, std, camera.rate)

    def innovation(
        self, measurements: Measurements, expected: ExpectedState
    ) -> Innovation:
        age = jnp.nan_to_num(measurements["camera_age"], nan=self.delay)
        steps = jnp.clip(age / self.period, 0.0, len(expected.past_bends) - 1.001)
        bends = interpolated(expected.past_bends, steps)
        states = interpolated(expected.past_states, steps)
        bends = bends + interpolated(expected.bias_change, steps)
        arcs, jacobian = with_jacobian(self._end_positions, bends)
        # where the forward model's ends differ from those of plain arcs
        arcs_at_states = self._end_positions(bends_from_states(states).reshape(-1))
        correction = states[:, :3].reshape(-1) - arcs_at_states
        # a picture is read up to one control step after its age was taken
        is_usable = (age >= 0.0) & (age <= self.max_delay + 1.01 * self.period)
        seen = self.model.to_base(measurements["camera_positions"])
        max_change = MAX_CHANGE * jnp.sum(self.lengths)
        beyond = jnp.linalg.norm(seen, axis=-1) - jnp.cumsum(self.lengths)
        is_usable &= ~(beyond > max_change).any()
        positions = seen.reshape(-1)
        residual = positions - arcs - correction
        sensed = interpolated(expected.past_sensed, steps).reshape(-1)
        return Innovation(
            jnp.where(is_usable, residual, jnp.nan),
            jacobian,
            jnp.full(arcs.shape, self.std),
            max_change=max_change,
            beside_encoders=positions - self._end_positions(sensed),
            age=age,
        )

    @property
    def value_count(self) -> int:
        return 3 * len(self.lengths)

    @property
    def max_silence(self) -> float:
        """See `SensorModel`: five pictures, or a second."""
        return max(1.0, 5.0 / self.rate) + self.delay

    def missing(self) -> dict[str, np.ndarray]:
        return {
            "camera_positions": np.full((len(self.lengths), 3), np.nan, np.float32),
            "camera_age": np.full((), np.nan, np.float32),
        }

    def _end_positions(self, bends: Float[Array, " bends"]) -> Float[Array, " values"]:
        states = states_from_bends(bends.reshape(-1, 2), self.lengths)
        return states[:, :3].reshape(-1)
