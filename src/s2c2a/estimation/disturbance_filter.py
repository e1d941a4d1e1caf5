"""A Kalman filter over payload, bend biases, vibration and sensor biases.

The state is [payload, bend biases, bends, bend rates, sensor biases]. The forward model
predicts the equilibrium, the modal model the vibration about it, and sensor models
compare both with measurements. None of these states is
observable from encoders, so without further sensors nothing is estimated.

Bruder et al. 2020 (arXiv 2002.01407) also add the payload to the state of a motion
model.
"""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from s2c2a.estimation import kalman
from s2c2a.estimation.modal_model import ModalTable
from s2c2a.estimation.sensor_models import (
    BiasPrior,
    ExpectedState,
    Innovation,
    Measurements,
    SensorModel,
)
from s2c2a.kinematics import bends_from_states, limit_lengths
from s2c2a.models.disturbances import Disturbances
from s2c2a.models.forward_model import ForwardModel

GATE = 6.0  # standard deviations; a larger innovation is an outlier
REJECTION_TIME = 0.5  # s; time for which a sensor is rejected after an outlier
AVERAGING_TIME = 0.3  # s; time constant of a sensor's average innovation
SLOW_AVERAGING_TIME = 2.0  # s; time constant of its usual residual
OFFSET_MEMORY = 60.0  # s; after which a lasting offset counts as true
MAX_VALUE = 1e6  # of any measurement, in any unit
START_ITERATIONS = 3  # of the moments of a known payload and the shape
MIN_HISTORY = 3  # control steps


class FilterOptions(NamedTuple):
    """Options of the filter; those of payloads are in parts of the arm's mass.

    Attributes:
        initial_payload_std: standard deviation of the initial payload.
        initial_bias_std: standard deviation of the initial bend biases [rad].
        payload_rate: standard deviation of the payload's change in one second.
        bias_rate: standard deviation of the bend biases' change in one second [rad].
        loaded_bias_rate: increase of `bias_rate` at a payload of the arm's mass [rad].
        bias_memory: time constant of the decay of unobserved bend biases [s].
        bend_noise: process noise of the bends in one second [rad].
        rate_noise: process noise of the bend rates in one second [rad/s].
        max_payload: largest estimated payload.
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
    max_payload: float = 3.0
    max_bend_bias: float = 0.4


class FilterState(NamedTuple):
    """State of the filter between updates.

    Attributes:
        mean: payload [kg], bend biases [rad], bends [rad], bend rates [rad/s], sensor
            biases, shape (1 + 3 n + biases,) with n = 2 modules.
        covariance: covariance of the state, shape (states, states).
        moments: moments of the payload at the present shape (`Disturbances`).
        hysteresis: memory of the forward model.
        past_bends: bends of the last control steps, newest first [rad], shape (steps,
            modules, 2).
        past_states: predicted states of these steps [m, 1], base frame, shape (steps,
            modules, 6).
        past_disturbance_bends: bends due to payload and bend biases in these steps
            [rad], shape (steps, modules, 2).
        lags: memory of each sensor's hysteresis.
        average_innovation: average normalized innovation of each sensor, shape
            (sensors,).
        usual_residuals: slow average of each sensor's residual against the encoders
            and the payload; `MAX_VALUE` before the first measurement.
        offsets: change of each sensor's usual residual while it was rejected; they are
            subtracted from its measurements.
        unseen_for: time since each sensor's last measurement [s], shape (sensors,).
        rejected_for: remaining time of rejection of each sensor [s], shape (sensors,).
    """

    mean: Float[Array, " states"]
    covariance: Float[Array, "states states"]
    moments: Disturbances
    hysteresis: Any
    past_bends: Float[Array, "steps modules 2"]
    past_states: Float[Array, "steps modules 6"]
    past_disturbance_bends: Float[Array, "steps modules 2"]
    lags: tuple[Array | np.ndarray, ...]
    average_innovation: Float[Array, " sensors"]
    usual_residuals: tuple[Array | np.ndarray, ...]
    offsets: tuple[Array | np.ndarray, ...]
    unseen_for: Float[Array, " sensors"]
    rejected_for: Float[Array, " sensors"]


class _History(NamedTuple):
    """A sensor compared with its own past.

    Attributes:
        usual: slow average of its residual, shape (values,).
        offset: change of that average while the sensor was rejected, shape (values,).
        unseen_for: time since its last measurement [s].
        has_changed: whether the residual has left its average.
    """

    usual: Float[Array, " values"]
    offset: Float[Array, " values"]
    unseen_for: Float[Array, ""]
    has_changed: Bool[Array, ""]


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

    def start(
        self, configuration: Float[Array, "modules 3"], payload: Float[Array, ""]
    ) -> FilterState:
        """State of an arm at rest.

        Args:
            configuration: configuration from the encoders, module frames.
            payload: known payload [kg].
        """
        hysteresis = self.model.start(configuration)
        moments = self._converged_moments(configuration, payload, hysteresis)
        states = self.model.predict(configuration, hysteresis, moments)
        bends = bends_from_states(states)
        count = bends.size
        prior = self._bias_prior()
        mean = jnp.concatenate(
            [
                payload[None],
                jnp.zeros(count),
                bends.reshape(-1),
                jnp.zeros(count + len(prior.initial_std)),
            ]
        )
        steps = self._history_length()
        return FilterState(
            mean=mean,
            covariance=jnp.diag(self._initial_std(count, prior) ** 2),
            moments=moments,
            hysteresis=hysteresis,
            past_bends=jnp.broadcast_to(bends, (steps, *bends.shape)),
            past_states=jnp.broadcast_to(states, (steps, *states.shape)),
            past_disturbance_bends=jnp.zeros((steps, *bends.shape)),
            lags=tuple(sensor.initial_lag(bends) for sensor in self.sensors),
            average_innovation=jnp.zeros(len(self.sensors)),
            usual_residuals=tuple(
                jnp.full(sensor.value_count, MAX_VALUE) for sensor in self.sensors
            ),
            offsets=tuple(jnp.zeros(sensor.value_count) for sensor in self.sensors),
            unseen_for=jnp.zeros(len(self.sensors)),
            rejected_for=jnp.zeros(len(self.sensors)),
        )

    def _converged_moments(
        self,
        configuration: Float[Array, "modules 3"],
        payload: Float[Array, ""],
        hysteresis: Any,
    ) -> Disturbances:
        """Moments of a known payload at the shape of the loaded arm."""
        none = Disturbances.none(len(configuration))
        known = none._replace(payload=payload)

        def iterate(_: Array, before: Disturbances) -> Disturbances:
            return self.model.with_moments(known, configuration, hysteresis, before)

        return jax.lax.fori_loop(0, START_ITERATIONS, iterate, known)

    def _initial_std(self, bends: int, prior: BiasPrior) -> Float[Array, " states"]:
        options = self.options
        slow = [options.initial_payload_std * self.mass]
        slow += [options.initial_bias_std] * bends
        fast = [options.bend_noise] * bends + [options.rate_noise] * bends
        slow_std = float(self.estimates) * jnp.array(slow)
        return jnp.concatenate([slow_std, jnp.array(fast), prior.initial_std])

    def _bias_prior(self) -> BiasPrior:
        """Prior of the biases of all sensors, concatenated."""
        priors = [sensor.bias_prior for sensor in self.sensors]
        return BiasPrior(
            jnp.concatenate([jnp.zeros(0), *(prior.initial_std for prior in priors)]),
            jnp.concatenate([jnp.zeros(0), *(prior.drift for prior in priors)]),
        )

    def _history_length(self) -> int:
        """Number of past control steps in the state, for delayed measurements."""
        latest = max((sensor.max_delay for sensor in self.sensors), default=0.0)
        return MIN_HISTORY + int(latest / self.period)

    # ---- update

    def update(
        self,
        state: FilterState,
        configuration: Float[Array, "modules 3"],
        measurements: Measurements,
    ) -> FilterState:
        """Predict to the present control step and update with its measurements.

        Args:
            state: state of the last control step.
            configuration: configuration from the encoders, module frames.
            measurements: values of the sensors; NaN where missing.
        """
        moments = self.model.with_moments(
            self.disturbances(state), configuration, state.hysteresis, state.moments
        )
        state = state._replace(moments=moments)
        states, tensions, by_payload = self._equilibrium(state, configuration)
        state = self._predicted(state, states, by_payload)
        for number, sensor in enumerate(self.sensors):
            expected = self._expected(state, tensions, by_payload, number)
            innovation = sensor.innovation(measurements, expected)
            state = self._updated(state, number, innovation, by_payload)
        state = self._limited(state)
        hysteresis = self.model.observe(configuration, state.hysteresis)
        return state._replace(hysteresis=hysteresis)

    def _equilibrium(
        self, state: FilterState, configuration: Float[Array, "modules 3"]
    ) -> tuple[Array, Array, Float[Array, " bends"]]:
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

        payload = state.mean[0]
        one = jnp.ones(())
        _, by_payload, (states, tensions) = jax.jvp(
            equilibrium, (payload,), (one,), has_aux=True
        )
        return states, tensions, by_payload.reshape(-1)

    def _predicted(
        self,
        state: FilterState,
        states: Float[Array, "modules 6"],
        by_payload: Float[Array, " bends"],
    ) -> FilterState:
        """Prediction step: the modal model over one control period."""
        equilibrium = bends_from_states(states)
        bends = equilibrium.size
        slow = 1 + bends
        fast = 1 + 3 * bends
        transition, inputs = self.modal_table.at(state.mean[0])
        fading = (
            jnp.ones(slow).at[1:].set(np.exp(-self.period / self.options.bias_memory))
        )
        by_slow_states = jnp.concatenate([by_payload[:, None], jnp.eye(bends)], axis=1)
        jacobian = (
            jnp.eye(len(state.mean))
            .at[:slow, :slow]
            .set(jnp.diag(fading))
            .at[slow:fast, :slow]
            .set(inputs @ by_slow_states * fading)
            .at[slow:fast, slow:fast]
            .set(transition)
        )
        vibration = transition @ state.mean[slow:fast]
        vibration = vibration + inputs @ equilibrium.reshape(-1)
        noise = self.process_noise(bends, state.mean[0])
        mean = jnp.concatenate(
            [fading * state.mean[:slow], vibration, state.mean[fast:]]
        )
        covariance = kalman.predict(state.mean, state.covariance, jacobian, noise)
        state = state._replace(mean=mean, covariance=covariance)
        compared = self._bends(state) if self._sees_vibration() else equilibrium
        caused = self._disturbance_bends(state, by_payload)
        return state._replace(
            past_bends=_pushed(state.past_bends, compared),
            past_states=_pushed(state.past_states, states),
            past_disturbance_bends=_pushed(state.past_disturbance_bends, caused),
        )

    def process_noise(
        self, bends: int, payload: Float[Array, ""] | float
    ) -> Float[Array, " states"]:
        """Process noise of a control step: variances, larger with a payload."""
        options = self.options
        bias_rate = options.bias_rate + options.loaded_bias_rate * payload / self.mass
        payload_rate = jnp.asarray(options.payload_rate * self.mass)
        slow = float(self.estimates) * jnp.stack([payload_rate, *[bias_rate] * bends])
        fast = jnp.repeat(jnp.array([options.bend_noise, options.rate_noise]), bends)
        drift = self._bias_prior().drift
        return jnp.concatenate([slow, fast, drift]) ** 2 * self.period

    def _expected(
        self,
        state: FilterState,
        tensions: Float[Array, "modules cables"],
        by_payload: Float[Array, " bends"],
        number: int,
    ) -> ExpectedState:
        """Expected state, from which a sensor model predicts its measurement."""
        caused = self._disturbance_bends(state, by_payload)
        return ExpectedState(
            bends=self._bends(state),
            bend_biases=self.disturbances(state).bend_biases,
            tensions=tensions,
            past_bends=state.past_bends,
            past_states=state.past_states,
            bias_change=caused - state.past_disturbance_bends,
            lag=state.lags[number],
        )

    def _updated(
        self,
        state: FilterState,
        number: int,
        innovation: Innovation,
        by_payload: Float[Array, " bends"],
    ) -> FilterState:
        """The state after the measurement of one sensor, unless it is an outlier.

        A large innovation that another payload would explain is no outlier: then the
        payload's variance grows, and the measurement is used.
        """
        residual, jacobian, is_present = self._observation(
            state, number, innovation, by_payload
        )
        covariance = kalman.innovation_covariance(
            state.covariance, jacobian, innovation.std
        )
        per_kg = jnp.where(is_present, innovation.jacobian @ by_payload, 0.0)
        change = self._payload_change(state, residual, covariance, per_kg)
        unexplained = residual - per_kg * change
        size = _gate_distance(residual, covariance, is_present)
        unexplained_size = _gate_distance(unexplained, covariance, is_present)
        smallest = jnp.minimum(size, unexplained_size)
        average = self._average_innovation(state, number, smallest, is_present)
        is_outlier = jnp.maximum(average, smallest) > GATE
        # with its offset: a sensor that is too far off stays rejected
        raw = jnp.where(is_present, unexplained + state.offsets[number], 0.0)
        is_outlier |= jnp.any(jnp.abs(raw) > innovation.max_residual)
        history = self._history(state, number, innovation, unexplained, is_present)
        is_outlier |= history.has_changed
        remaining = jnp.maximum(state.rejected_for[number] - self.period, 0.0)
        rejected_for = jnp.where(is_outlier, REJECTION_TIME, remaining)
        is_used = rejected_for <= 0.0
        variance = jnp.where((size > GATE) & is_used, change, 0.0) ** 2
        mean, new_covariance = kalman.update(
            state.mean,
            state.covariance.at[0, 0].add(variance),
            residual,
            jnp.where(is_used, jacobian, 0.0),
            covariance + variance * jnp.outer(jacobian[:, 0], jacobian[:, 0]),
        )
        lags = list(state.lags)
        lags[number] = innovation.lag
        usual_residuals = list(state.usual_residuals)
        usual_residuals[number] = history.usual
        offsets = list(state.offsets)
        offsets[number] = history.offset
        return state._replace(
            mean=mean,
            covariance=(new_covariance + new_covariance.T) / 2.0,
            lags=tuple(lags),
            average_innovation=state.average_innovation.at[number].set(average),
            usual_residuals=tuple(usual_residuals),
            offsets=tuple(offsets),
            unseen_for=state.unseen_for.at[number].set(history.unseen_for),
            rejected_for=state.rejected_for.at[number].set(rejected_for),
        )

    def _observation(
        self,
        state: FilterState,
        number: int,
        innovation: Innovation,
        by_payload: Float[Array, " bends"],
    ) -> tuple[Array, Array, Bool[Array, " values"]]:
        """Residual and its Jacobian by the state; zero where values are missing."""
        sensor = self.sensors[number]
        residual = innovation.residual
        is_present = jnp.abs(residual) < MAX_VALUE  # false for NaN
        bends = by_payload.size
        # measurements depend on the bend biases at equilibrium, or on the vibration
        first = 1 if sensor.measures_equilibrium else 1 + bends
        jacobian = jnp.zeros((len(residual), len(state.mean)))
        jacobian = jacobian.at[:, first : first + bends].set(innovation.jacobian)
        if sensor.measures_equilibrium:
            jacobian = jacobian.at[:, 0].set(innovation.jacobian @ by_payload)
        biases = self.biases_of(number, bends)
        if biases.start < biases.stop:
            jacobian = jacobian.at[:, biases].set(jnp.eye(len(residual)))
            residual = residual - state.mean[biases]
        residual = residual - state.offsets[number]
        residual = jnp.where(is_present, residual, 0.0)
        return residual, jnp.where(is_present[:, None], jacobian, 0.0), is_present

    def biases_of(self, number: int, bends: int) -> slice:
        """Slice of the state with the biases of a sensor."""
        lengths = [len(sensor.bias_prior.initial_std) for sensor in self.sensors]
        start = 1 + 3 * bends + sum(lengths[:number])
        return slice(start, start + lengths[number])

    def _payload_change(
        self,
        state: FilterState,
        residual: Float[Array, " values"],
        covariance: Float[Array, "values values"],
        per_kg: Float[Array, " values"],
    ) -> Float[Array, ""]:
        """Maximum a posteriori change of the payload, from the residual [kg]."""
        if not self.estimates:
            return jnp.zeros(())
        weights = jnp.linalg.solve(covariance, per_kg)
        change = (weights @ residual) / (weights @ per_kg + 1.0 / self.mass**2)
        payload = state.mean[0]
        return jnp.clip(
            change, -payload, self.options.max_payload * self.mass - payload
        )

    def _average_innovation(
        self,
        state: FilterState,
        number: int,
        size: Float[Array, ""],
        is_present: Bool[Array, " values"],
    ) -> Float[Array, ""]:
        """Moving average of a sensor's innovations, in standard deviations."""
        share = min(self.period / AVERAGING_TIME, 1.0)
        weight = jnp.where(is_present.any(), share, 0.0)
        average = state.average_innovation[number]
        return average + weight * (size - average)

    def _history(
        self,
        state: FilterState,
        number: int,
        innovation: Innovation,
        unexplained: Float[Array, " values"],
        is_present: Bool[Array, " values"],
    ) -> _History:
        """Compare a sensor with its own past, by its residual against the encoders.

        A residual that leaves its slow average shows a fault: drift, wrong latency or a
        jump. The bend biases count as residual, so a fault that moves them shows, too.
        After an external force the average follows. Its change while the sensor is
        rejected becomes an offset, so that a jump moves the estimate by little more
        than `max_change`, whatever its size. A sensor that agrees with the encoders
        again, as after a repair, has no offset.
        """
        elapsed = state.unseen_for[number] + self.period
        before = state.usual_residuals[number]
        biases = state.mean[1 : 1 + innovation.jacobian.shape[-1]]
        residual = unexplained + state.offsets[number] + innovation.jacobian @ biases
        start = jnp.where(before == MAX_VALUE, residual, before)
        share = jnp.minimum(elapsed / SLOW_AVERAGING_TIME, 1.0)
        change = jnp.where(is_present, share * (residual - start), 0.0)
        usual = start + change
        deviation = jnp.where(is_present, residual - usual, 0.0)
        has_changed = jnp.any(jnp.abs(deviation) > innovation.max_change)
        fading = np.exp(-self.period / OFFSET_MEMORY)
        offset = fading * state.offsets[number] + jnp.where(has_changed, change, 0.0)
        agrees = (jnp.abs(residual) < innovation.max_change) | ~is_present
        offset = jnp.where(agrees.all() & is_present.any(), 0.0, offset)
        return _History(
            usual=jnp.where(is_present, usual, before),
            offset=offset,
            unseen_for=jnp.where(is_present.any(), 0.0, elapsed),
            has_changed=has_changed,
        )

    def is_unused(self, state: FilterState) -> Bool[Array, " sensors"]:
        """Whether each sensor is rejected, or has given no measurement for too long."""
        longest = jnp.array([sensor.max_silence for sensor in self.sensors])
        return (state.rejected_for > 0.0) | (state.unseen_for > longest)

    def _limited(self, state: FilterState) -> FilterState:
        """Payload, bend biases and external force within their limits."""
        options = self.options
        payload = jnp.clip(state.mean[0], 0.0, options.max_payload * self.mass)
        biases = self.disturbances(state).bend_biases
        biases = limit_lengths(biases, options.max_bend_bias).reshape(-1)
        force = jnp.maximum(self.external_force(biases), 1e-9)
        biases = biases * jnp.minimum(1.0, self.max_force / force)
        rest = state.mean[1 + biases.size :]
        return state._replace(mean=jnp.concatenate([payload[None], biases, rest]))

    # ---- parts of the state

    def disturbances(self, state: FilterState) -> Disturbances:
        """Payload and bend biases, with the moments of the payload."""
        bends = state.past_bends[0].size
        biases = state.mean[1 : 1 + bends].reshape(-1, 2)
        moments = state.moments.with_payload(state.mean[0])
        return moments._replace(bend_biases=biases)

    def external_force(self, bend_biases: Float[Array, " bends"]) -> Float[Array, ""]:
        """Force at the tip that would cause the bend biases [N]."""
        return jnp.linalg.norm(self.modal_table.forces @ bend_biases)

    def _bends(self, state: FilterState) -> Float[Array, "modules 2"]:
        bends = state.past_bends[0].size
        return state.mean[1 + bends : 1 + 2 * bends].reshape(-1, 2)

    def _disturbance_bends(
        self, state: FilterState, by_payload: Float[Array, " bends"]
    ) -> Float[Array, "modules 2"]:
        """Bends due to payload and bend biases [rad]."""
        by_weight = (state.mean[0] * by_payload).reshape(-1, 2)
        return self.disturbances(state).bend_biases + by_weight

    def _sees_vibration(self) -> bool:
        """Whether the vibration is observable."""
        return any(not sensor.measures_equilibrium for sensor in self.sensors)


def _gate_distance(
    residual: Float[Array, " values"],
    covariance: Float[Array, "values values"],
    is_present: Bool[Array, " values"],
) -> Float[Array, ""]:
    """Normalized innovation, limited so that its average recovers quickly."""
    size = kalman.normalized_innovation(residual, covariance, is_present)
    return jnp.minimum(size, 2.0 * GATE)


def _pushed(
    history: Float[Array, "steps *shape"], newest: Float[Array, "*shape"]
) -> Float[Array, "steps *shape"]:
    return jnp.concatenate([newest[None], history[:-1]])
