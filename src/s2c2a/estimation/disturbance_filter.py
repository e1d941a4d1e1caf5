"""A Kalman filter over payload, bend biases, vibration and sensor biases (`ArmState`).

The forward model predicts the equilibrium, the modal model the vibration about it, and
sensor models compare both with measurements. None of these states is observable from
encoders, so without further sensors nothing is estimated.

Bruder et al. 2020 (arXiv 2002.01407) also add the payload to the state of a motion
model.
"""

from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.arm.spec import HEAVIEST
from s2c2a.estimation import kalman
from s2c2a.estimation.bias_field import INTERVAL, STD, BiasField, PayloadPrior
from s2c2a.estimation.filter_state import ArmState, FilterState, StateOrder
from s2c2a.estimation.modal_model import ModalTable
from s2c2a.estimation.outliers import Compared, SensorHistory, is_beyond_gate, judged
from s2c2a.estimation.sensor_models import (
    ExpectedState,
    Innovation,
    Measurements,
    SensorModel,
    interpolated,
)
from s2c2a.files.text import LARGEST
from s2c2a.kinematics import bends_from_configurations, bends_from_states, limit_lengths
from s2c2a.kinematics.bends import FlatBends, Scalar, Truth
from s2c2a.models.arrays import Configuration, ModuleBends
from s2c2a.models.disturbances import Disturbances
from s2c2a.models.forward_model import ForwardModel

# control steps in the past: the present one, and two to interpolate between
MIN_HISTORY = 3
UNCLEAR = STD / 2.0
"""Bends [rad] whose mean effect on positions counts as noise.

Along directions that pictures hardly show, biases then stay small; along the others, a
fifth of a residual is left to the next picture.
"""


@dataclass(frozen=True)
class FilterOptions:
    """Options of the filter; the standard deviations are those of random walks.

    The payload is estimated more slowly than the first bending mode of the arm moves:
    faster estimates follow the vibration, and the plan follows them
    (docs/concepts/estimation.md). `s2c2a reproduce sensors` and `payloads` measure the
    defaults together.

    Attributes:
        initial_payload_std: standard deviation of the initial payload, in parts of the
            arm's mass.
        initial_bias_std: standard deviation of the initial bend biases [rad].
        payload_rate: standard deviation of the payload's change in one second, in parts
            of the arm's mass.
        bias_rate: standard deviation of the bend biases' change in one second [rad].
        loaded_bias_rate: increase of `bias_rate` at a payload of the arm's mass [rad].
        bias_memory: time constant of the decay of unobserved bend biases [s].
        bend_noise: process noise of the bends in one second [rad].
        rate_noise: process noise of the bend rates in one second [rad/s].
        max_payload: largest estimated payload, in parts of the arm's mass.
        max_bend_bias: largest estimated bend bias of a module [rad].
    """

    initial_payload_std: float = 0.4
    initial_bias_std: float = 0.02
    payload_rate: float = 0.007
    bias_rate: float = 0.003
    loaded_bias_rate: float = 0.006
    bias_memory: float = 5.0
    bend_noise: float = 0.04
    rate_noise: float = 1.0
    max_payload: float = HEAVIEST
    max_bend_bias: float = 0.4


class DisturbanceFilter(eqx.Module):
    """Kalman filter of one arm, as a pure function of its state.

    Attributes:
        model: forward model; predicts the equilibrium.
        modal_table: modal models by payload; predict the vibration.
        sensors: sensor models.
        options: options of the filter.
        mass: mass of the arm [kg].
        period: control period [s].
        estimates: whether payload and bend biases are estimated; otherwise they keep
            their initial values.
        max_force: largest external force at the tip for the bend biases [N].
    """

    model: ForwardModel
    modal_table: ModalTable
    sensors: tuple[SensorModel, ...]
    options: FilterOptions = eqx.field(static=True)
    mass: float = eqx.field(static=True)
    period: float = eqx.field(static=True)
    estimates: bool = eqx.field(static=True, default=True)
    max_force: float = eqx.field(static=True, default=np.inf)

    # ---- start

    def start(self, configuration: Configuration, payload: Scalar) -> FilterState:
        """State of an arm at rest.

        Args:
            configuration: configuration from the encoders, module frames.
            payload: known payload [kg].
        """
        hysteresis = self.model.start(configuration)
        known = Disturbances.none(len(configuration))._replace(payload=payload)
        moments = self.model.settled(known, configuration, hysteresis)
        states = self.model.predict(configuration, hysteresis, moments)
        bends = bends_from_states(states)
        zeros = jnp.zeros(bends.size)
        options = self.options
        is_estimated = float(self.estimates)
        biases = [sensor.bias_prior.initial_std for sensor in self.sensors]
        initial_std = ArmState(
            payload=jnp.asarray(is_estimated * options.initial_payload_std * self.mass),
            bend_biases=jnp.full(bends.size, is_estimated * options.initial_bias_std),
            bends=jnp.full(bends.size, options.bend_noise),
            bend_rates=jnp.full(bends.size, options.rate_noise),
            sensor_biases=jnp.concatenate([jnp.zeros(0), *biases]),
        )
        mean = ArmState(
            payload=payload,
            bend_biases=zeros,
            bends=bends.reshape(-1),
            bend_rates=zeros,
            sensor_biases=jnp.zeros_like(initial_std.sensor_biases),
        )
        latest = max((sensor.max_delay for sensor in self.sensors), default=0.0)
        steps = MIN_HISTORY + int(latest / self.period)  # for delayed measurements
        sensed = bends_from_configurations(configuration)
        sees_ends = any(sensor.sees_ends for sensor in self.sensors)
        return FilterState(
            mean=mean,
            covariance=jnp.diag(initial_std.packed() ** 2),
            moments=moments,
            hysteresis=hysteresis,
            past_bends=jnp.broadcast_to(bends, (steps, *bends.shape)),
            past_states=jnp.broadcast_to(states, (steps, *states.shape)),
            past_disturbance_bends=jnp.zeros((steps, *bends.shape)),
            past_sensed=jnp.broadcast_to(sensed, (steps, *bends.shape)),
            histories=tuple(
                SensorHistory.none(sensor.value_count, sensor.initial_lag(bends))
                for sensor in self.sensors
            ),
            # biases are learned as a function of the shape
            field=BiasField.empty(bends.size) if self.estimates and sees_ends else None,
            expected_biases=zeros,
            known_payload=payload,
        )

    @property
    def _order(self) -> StateOrder:
        """Order of the state in vectors and matrices."""
        counts = [len(sensor.bias_prior.initial_std) for sensor in self.sensors]
        return StateOrder.of(self.modal_table.forces.shape[-1], counts)

    # ---- update

    def update(
        self,
        state: FilterState,
        configuration: Configuration,
        measurements: Measurements,
    ) -> FilterState:
        """Predict to the present control step and update with its measurements.

        Args:
            state: state of the last control step.
            configuration: configuration from the encoders, module frames.
            measurements: values of the sensors; NaN where missing.
        """
        sensed = bends_from_configurations(configuration)
        state = state._replace(past_sensed=_pushed(state.past_sensed, sensed))
        if state.field is not None:
            field = state.field.aged(self.period)
            biases = field.at(sensed.reshape(-1))
            state = state._replace(field=field, expected_biases=biases)
        moments = self.model.with_moments(
            state.disturbances, configuration, state.hysteresis, state.moments
        )
        state = state._replace(moments=moments)
        states, tensions, by_payload = self._equilibrium(state, configuration)
        state = self._predicted(state, states, by_payload)
        for number, sensor in enumerate(self.sensors):
            caused = _disturbance_bends(state.mean, by_payload)
            expected = ExpectedState(
                bends=state.mean.bends.reshape(-1, 2),
                bend_biases=state.disturbances.bend_biases,
                tensions=tensions,
                past_bends=state.past_bends,
                past_sensed=state.past_sensed,
                past_states=state.past_states,
                bias_change=caused - state.past_disturbance_bends,
                lag=state.histories[number].lag,
            )
            innovation = sensor.innovation(measurements, expected)
            before = state.mean
            state = self._updated(state, number, innovation, by_payload)
            if sensor.sees_ends and state.field is not None:
                caused = _disturbance_bends(state.mean, by_payload).reshape(-1)
                change = caused - _disturbance_bends(before, by_payload).reshape(-1)
                residual = innovation.residual - innovation.jacobian @ change
                remaining = innovation._replace(residual=residual)
                field = self._taught(state, state.field, number, remaining, by_payload)
                state = state._replace(field=field)
        state = state._replace(mean=self._limited(state))
        hysteresis = self.model.observe(configuration, state.hysteresis)
        return state._replace(hysteresis=hysteresis)

    def _equilibrium(
        self, state: FilterState, configuration: Configuration
    ) -> tuple[Array, Array, FlatBends]:
        """Predicted states and tensions in equilibrium.

        Returns:
            States [m, 1], tensions [N], and the derivative of the bends by the payload
            [rad/kg].
        """

        def equilibrium(payload: Array) -> tuple[Array, tuple[Array, Array]]:
            disturbances = state.moments.with_payload(payload)
            states = self.model.predict(configuration, state.hysteresis, disturbances)
            tensions = self.model.tensions(
                configuration, state.hysteresis, disturbances
            )
            return bends_from_states(states), (states, tensions)

        one = jnp.ones(())
        _, by_payload, (states, tensions) = jax.jvp(
            equilibrium, (state.mean.payload,), (one,), has_aux=True
        )
        return states, tensions, by_payload.reshape(-1)

    def _predicted(
        self,
        state: FilterState,
        states: Float[Array, "modules 6"],
        by_payload: FlatBends,
    ) -> FilterState:
        """Prediction step: the modal model over one control period."""
        mean = state.mean
        equilibrium = bends_from_states(states)
        transition, inputs = self.modal_table.at(mean.payload)
        fading = np.exp(-self.period / self.options.bias_memory)
        vibration = transition @ jnp.concatenate([mean.bends, mean.bend_rates])
        vibration = vibration + inputs @ equilibrium.reshape(-1)
        bends, bend_rates = jnp.split(vibration, 2)
        order = self._order
        by_state = (
            jnp.eye(order.size)
            .at[order.bend_biases, order.bend_biases]
            .multiply(fading)
            .at[order.vibration, order.payload]
            .set((inputs @ by_payload)[:, None])
            .at[order.vibration, order.bend_biases]
            .set(inputs * fading)
            .at[order.vibration, order.vibration]
            .set(transition)
        )
        options = self.options
        is_estimated = float(self.estimates)
        share = mean.payload / self.mass
        bias_rate = options.bias_rate + options.loaded_bias_rate * share
        drifts = [sensor.bias_prior.drift for sensor in self.sensors]
        noise = ArmState(
            payload=jnp.asarray(is_estimated * options.payload_rate * self.mass),
            bend_biases=jnp.full_like(mean.bend_biases, is_estimated * bias_rate),
            bends=jnp.full_like(mean.bends, options.bend_noise),
            bend_rates=jnp.full_like(mean.bend_rates, options.rate_noise),
            sensor_biases=jnp.concatenate([jnp.zeros(0), *drifts]),
        )
        variances = noise.packed() ** 2 * self.period
        covariance = kalman.predict(state.covariance, by_state, variances)
        mean = mean._replace(
            bend_biases=fading * mean.bend_biases, bends=bends, bend_rates=bend_rates
        )
        state = state._replace(mean=mean, covariance=covariance)
        shape = equilibrium.shape
        sees_vibration = any(not each.measures_equilibrium for each in self.sensors)
        compared = bends.reshape(shape) if sees_vibration else equilibrium
        caused = _disturbance_bends(mean, by_payload)
        return state._replace(
            past_bends=_pushed(state.past_bends, compared),
            past_states=_pushed(state.past_states, states),
            past_disturbance_bends=_pushed(state.past_disturbance_bends, caused),
        )

    def _updated(
        self,
        state: FilterState,
        number: int,
        innovation: Innovation,
        by_payload: FlatBends,
    ) -> FilterState:
        """The state after the measurement of one sensor, unless it is an outlier.

        A large innovation that another payload would explain is no outlier.
        """
        order = self._order
        histories = state.histories
        history = histories[number]
        residual = innovation.residual
        is_present = jnp.abs(residual) < LARGEST  # false for NaN
        jacobian = jnp.zeros((len(residual), order.size))
        # measurements depend on the bend biases at equilibrium, or on the vibration
        if self.sensors[number].measures_equilibrium:
            slopes = innovation.jacobian @ by_payload
            jacobian = jacobian.at[:, order.payload].set(slopes[:, None])
            jacobian = jacobian.at[:, order.bend_biases].set(innovation.jacobian)
        else:
            jacobian = jacobian.at[:, order.bends].set(innovation.jacobian)
        biases = order.sensor_biases[number]
        if biases.start < biases.stop:
            jacobian = jacobian.at[:, biases].set(jnp.eye(len(residual)))
            residual = residual - state.mean.packed()[biases]
        residual = jnp.where(is_present, residual, 0.0)
        jacobian = jnp.where(is_present[:, None], jacobian, 0.0)
        covariance = kalman.innovation_covariance(
            state.covariance, jacobian, innovation.std
        )
        per_kg = jnp.where(is_present, innovation.jacobian @ by_payload, 0.0)
        if self.estimates:
            # maximum a posteriori change of the payload, from the residual [kg]
            weights = jnp.linalg.solve(covariance, per_kg)
            change = (weights @ residual) / (weights @ per_kg + 1.0 / self.mass**2)
            largest = self.options.max_payload * self.mass
            payload = state.mean.payload
            change = jnp.clip(change, -payload, largest - payload)
        else:
            change = jnp.zeros(())
        unexplained = residual - per_kg * change
        is_outlier = is_beyond_gate(unexplained, covariance, is_present)
        compared = Compared(
            unexplained=unexplained,
            by_biases=innovation.jacobian @ state.disturbances.bend_biases.reshape(-1),
            is_present=is_present,
            innovation=innovation,
        )
        history = judged(history, compared, is_outlier, self.period)
        is_used = history.rejected_for <= 0.0
        used = jnp.where(is_used, jacobian, 0.0)
        mean, new_covariance = kalman.update(
            state.mean.packed(), state.covariance, residual, used, covariance
        )
        return state._replace(
            mean=order.unpacked(mean),
            covariance=(new_covariance + new_covariance.T) / 2.0,
            histories=(*histories[:number], history, *histories[number + 1 :]),
        )

    def _taught(
        self,
        state: FilterState,
        field: BiasField,
        number: int,
        remaining: Innovation,
        by_payload: FlatBends,
    ) -> BiasField:
        """The field of the biases with a picture.

        Outliers teach nothing, nor do pictures soon after the last one.

        Args:
            state: updated with the picture.
            field: before the picture.
            number: of the sensor.
            remaining: innovation after that update.
            by_payload: derivative of the bends by the payload [rad/kg].
        """
        is_present = jnp.abs(remaining.residual) < LARGEST  # false for NaN
        is_trusted = state.histories[number].rejected_for <= 0.0
        age = jnp.asarray(remaining.age)
        is_later = jnp.min(field.pictures.ages) - age > INTERVAL
        jacobian = jnp.where(is_present[:, None], remaining.jacobian, 0.0)
        residual = jnp.where(is_present, remaining.residual, 0.0)
        oldest = len(state.past_sensed) - 1.001
        steps = jnp.clip(age / self.period, 0.0, oldest)
        bends = interpolated(state.past_sensed, steps).reshape(-1)

        def taught() -> BiasField:
            known = _disturbance_bends(state.mean, by_payload).reshape(-1)
            # most likely biases that explain positions [rad], before a mean over
            # pictures
            by_biases = jacobian @ jacobian.T
            noise = UNCLEAR**2 * jnp.trace(by_biases) / len(residual)
            covariance = STD**2 * by_biases + noise * jnp.eye(len(residual))
            further = STD**2 * jacobian.T @ jnp.linalg.solve(covariance, residual)
            caused = field.at(bends) + known + further
            payload_std = self.options.initial_payload_std * self.mass
            prior = PayloadPrior(state.known_payload, payload_std)
            return field.with_picture(bends, caused, by_payload, age, prior)

        is_used = is_present.any() & is_trusted & is_later
        return jax.lax.cond(is_used, taught, lambda: field)

    def unused(self, state: FilterState) -> dict[str, Truth]:
        """Whether each sensor is rejected, or has given no measurement for too long."""
        return {
            sensor.name: (history.rejected_for > 0.0)
            | (history.unseen_for > sensor.max_silence)
            for sensor, history in zip(self.sensors, state.histories, strict=True)
        }

    def _limited(self, state: FilterState) -> ArmState:
        """Payload, bend biases and external force within their limits."""
        options = self.options
        mean = state.mean
        all_biases = state.expected_biases + mean.bend_biases
        payload = jnp.clip(mean.payload, 0.0, options.max_payload * self.mass)
        pairs = all_biases.reshape(-1, 2)
        biases = limit_lengths(pairs, options.max_bend_bias).reshape(-1)
        force = jnp.maximum(self.external_force(biases), 1e-9)  # no division by zero
        biases = biases * jnp.minimum(1.0, self.max_force / force)
        rest = biases - state.expected_biases
        return mean._replace(payload=payload, bend_biases=rest)

    def external_force(self, bend_biases: FlatBends) -> Scalar:
        """Force at the tip that would cause the bend biases [N]."""
        return jnp.linalg.norm(self.modal_table.forces @ bend_biases)


def _disturbance_bends(mean: ArmState, by_payload: FlatBends) -> ModuleBends:
    """Bends due to payload and bend biases [rad]."""
    return (mean.bend_biases + mean.payload * by_payload).reshape(-1, 2)


def _pushed(
    history: Float[Array, "steps *shape"], newest: Float[Array, "*shape"]
) -> Float[Array, "steps *shape"]:
    return jnp.concatenate([newest[None], history[:-1]])
