"""What is known of an arm while it works: a Kalman filter over what no sensor says, and over how the arm swings.

Its state is a load at the tip, leans of the modules (bends beside those that are
expected: offsets of homing, drift, a softened cable, a push), bends and their rates,
and zeros of sensors. The forward model says where the arm would rest, the swing how it
gets there, sensors what of it is seen; encoders alone see nothing of it. What a forward
model is told of loads and leans (`Disturbances`) lets planner and feasibility count on
them.

A load as a state beside those of a model of motion is Bruder et al. 2020 (arXiv
2002.01407).
"""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.arm import ArmSpec
from s2c2a.estimation.belief import Belief
from s2c2a.estimation.gains import Gains
from s2c2a.estimation.sensors import Off, Said, Sense, Shape, Zeros
from s2c2a.kinematics import ForwardModel, bends_from_states, limit_lengths

# before anything is sensed: of the arm's mass, and [rad]
FIRST_LOAD = 0.4
FIRST_LEAN = 0.02
FORGET = 5.0  # s; a lean that nothing shows any more is forgotten
# what they may change by in a second: of the arm's mass, and [rad]
LOAD_RATE = 0.07
LEAN_RATE = 0.03
# rad; a lean of an arm that carries as much as it weighs, beside that
LOADED_RATE = 0.06
# of the swing, in a second [rad, rad/s]
BEND_NOISE = 0.04
TURN_NOISE = 1.0
# of the arm's mass, and [rad]
MAX_LOAD = 3.0
MAX_LEAN = 0.4
MAX_CALMING = 0.2  # rad; asked for beside the plan
ABSURD = 1e6  # in any unit
# standard deviations; and s
STRANGE = 6.0
LEFT_OUT_FOR = 0.5
SETTLING = 0.3  # s; over which strangeness is told


class Observer(eqx.Module):
    """Watches an arm.

    Attributes:
        gains: by load.
        sensors: what is seen of it beside encoders; none, and nothing is learned of it.
        mass: of the arm [kg].
        period: of the control steps [s].
        estimates: whether load and leans are estimated, or stay as they are told.
        yields: to what leans on it: no more than this force at the tip is made up for
            [N].
    """

    gains: Gains
    sensors: tuple[Sense, ...]
    mass: float = eqx.field(static=True)
    period: float = eqx.field(static=True)
    estimates: bool = eqx.field(static=True, default=True)
    yields: float = eqx.field(static=True, default=np.inf)

    @classmethod
    def of(
        cls,
        arm: ArmSpec,
        gains: Gains,
        sensors: tuple[Sense, ...],
        estimates: bool = True,
        yields: float = np.inf,
    ) -> "Observer":
        """Of an arm."""
        mass = sum(module.mass for module in arm.modules)
        return cls(gains, sensors, mass, arm.control_period, estimates, yields)

    @property
    def kept(self) -> float:
        """What is left of a lean after a control step that showed nothing of it."""
        return float(np.exp(-self.period / FORGET))

    @property
    def calming(self) -> bool:
        """Whether anything is done against the swing: something must see it at once."""
        return any(not sense.slow for sense in self.sensors)

    @property
    def history(self) -> int:
        """How many steps are remembered, for what is told late."""
        return 3 + int(
            max((sense.latest for sense in self.sensors), default=0.0) / self.period
        )

    def start(
        self, states: Float[Array, "modules 6"], load: Float[Array, ""]
    ) -> Belief:
        """Of an arm at rest.

        Args:
            states: at which a forward model says it is.
            load: at its tip, as far as it is told [kg].
        """
        rests = bends_from_states(states)
        bends = rests.size
        none = jnp.zeros_like(rests)
        zeros = self._zeros().first
        mean = jnp.concatenate(
            [
                load[None],
                jnp.zeros(bends),
                rests.reshape(-1),
                jnp.zeros(bends + len(zeros)),
            ]
        )
        slow = float(self.estimates) * np.array(
            [FIRST_LOAD * self.mass, *[FIRST_LEAN] * bends]
        )
        spread = jnp.array([*slow, *[BEND_NOISE] * bends, *[TURN_NOISE] * bends])
        covariance = jnp.diag(jnp.concatenate([spread, zeros]) ** 2)
        before, there = (
            jnp.broadcast_to(part, (self.history, *part.shape))
            for part in (rests, states)
        )
        quiet = jnp.zeros(len(self.sensors))
        found = jnp.zeros((self.history, *rests.shape))
        lagging = tuple(sense.lagging(rests) for sense in self.sensors)
        return Belief(
            mean, covariance, none, rests, before, there, found, lagging, quiet, quiet
        )

    def update(
        self,
        belief: Belief,
        model: ForwardModel,
        memory: Any,
        sensed: Float[Array, "modules 3"],
        planned: Float[Array, "modules 3"],
        said: Said,
    ) -> tuple[Belief, Any]:
        """What is believed after one more reading, and the memory of a model that counts on it.

        Args:
            belief: before.
            model: says where the arm would rest.
            memory: of the model, before this reading.
            sensed: configurations, by the encoders.
            planned: configurations that were planned in the last step.
            said: what sensors say; NaN where nothing.
        """
        memory = model.given(belief.disturbances, sensed, memory)
        expected, tensions, (rests, slopes) = self._rest(belief, model, memory, sensed)
        belief = self._moved(belief, rests, slopes)
        by_load = slopes[:, 0]
        belief = belief._replace(
            before=_pushed(
                belief.before, self._where(belief) if self.calming else rests
            ),
            states_before=_pushed(belief.states_before, expected),
            found_before=_pushed(belief.found_before, self._found(belief, by_load)),
        )
        for number, sense in enumerate(self.sensors):
            since = self._found(belief, by_load) - belief.found_before
            past = belief.before, belief.states_before, since
            shape = Shape(
                self._where(belief),
                belief.disturbances.leans,
                tensions,
                *past,
                belief.lagging[number],
            )
            belief = self._told(belief, number, sense, sense.off(said, shape), by_load)
        belief = self._within(belief)
        memory = model.corrected(belief.disturbances, memory)
        return self._calmed(
            belief, bends_from_states(model.predict(planned, memory))
        ), memory

    def _rest(self, belief: Belief, model: ForwardModel, memory: Any, sensed: Array):
        """Where the arm would rest, and how its bends there change with load and leans."""

        def rest(load: Array) -> tuple[Array, tuple[Array, Array]]:
            known = model.corrected(belief.disturbances._replace(load=load), memory)
            states = model.predict(sensed, known)
            return bends_from_states(states), (states, model.tensions(sensed, known))

        rests, by_load, (states, tensions) = jax.jvp(
            rest, (belief.mean[0],), (jnp.ones(()),), has_aux=True
        )
        slopes = jnp.concatenate([by_load.reshape(-1, 1), jnp.eye(rests.size)], axis=1)
        return states, tensions, (rests, slopes)

    def _moved(
        self, belief: Belief, rests: Float[Array, "modules 2"], slopes: Array
    ) -> Belief:
        """One control step of the swing, as it is expected."""
        slow = 1 + rests.size
        fast = 1 + 3 * rests.size
        steps, inputs, _, _ = self.gains.at(belief.mean[0])
        motion = steps @ belief.mean[slow:fast] + inputs @ rests.reshape(-1)
        kept = jnp.ones(slow).at[1:].set(self.kept)
        change = jnp.eye(len(belief.mean)).at[:slow, :slow].set(jnp.diag(kept))
        change = (
            change.at[slow:fast, :slow]
            .set(inputs @ slopes * kept)
            .at[slow:fast, slow:fast]
            .set(steps)
        )
        noise = self.noise(rests.size, belief.mean[0])
        covariance = change @ belief.covariance @ change.T + jnp.diag(noise)
        mean = jnp.concatenate([kept * belief.mean[:slow], motion, belief.mean[fast:]])
        return belief._replace(mean=mean, covariance=covariance)

    def noise(
        self, bends: int, load: Float[Array, ""] | float
    ) -> Float[Array, " states"]:
        """What a control step adds to the variance of all that is believed; models err more under loads."""
        lean = LEAN_RATE + LOADED_RATE * load / self.mass
        slow = float(self.estimates) * jnp.stack(
            [jnp.asarray(LOAD_RATE * self.mass), *[lean] * bends]
        )
        swing = jnp.repeat(jnp.array([BEND_NOISE, TURN_NOISE]), bends)
        return jnp.concatenate([slow, swing, self._zeros().wander]) ** 2 * self.period

    def zeros_of(self, number: int, bends: int) -> slice:
        """Where those of a sense stand in the state."""
        begin, *counts = (
            1 + 3 * bends,
            *(len(sense.zeros.first) for sense in self.sensors),
        )
        begin += sum(counts[:number])
        return slice(begin, begin + counts[number])

    def _zeros(self) -> Zeros:
        every = Zeros.none(), *(sense.zeros for sense in self.sensors)
        return Zeros(*(jnp.concatenate(part) for part in zip(*every, strict=True)))

    def _where(self, belief: Belief) -> Float[Array, "modules 2"]:
        bends = belief.calming.size
        return belief.mean[1 + bends : 1 + 2 * bends].reshape(-1, 2)

    def _found(self, belief: Belief, by_load: Array) -> Float[Array, "modules 2"]:
        """What is known of bends at rest beside what encoders tell."""
        return belief.disturbances.leans + (belief.mean[0] * by_load).reshape(-1, 2)

    def _told(
        self, belief: Belief, number: int, sense: Sense, off: Off, by_load: Array
    ) -> Belief:
        """After what one sense says; one that is too strange, or says nothing, is left out."""
        numbers, slopes, heard = self._against(belief, number, sense, off, by_load)
        # what a kilogram more would look like
        hung = jnp.where(heard, off.slopes @ by_load, 0.0)
        spread = slopes @ belief.covariance @ slopes.T + jnp.diag(
            (self.gains.at(belief.mean[0])[3] * off.spread) ** 2
        )
        change, unless = self._unless_hung(belief, numbers, spread, hung)
        surprise, less = (_surprise(one, spread, heard) for one in (numbers, unless))
        strange = self._strange(belief, number, jnp.minimum(surprise, less), heard)
        wrong = (jnp.maximum(strange, jnp.minimum(surprise, less)) > STRANGE) | (
            jnp.abs(unless).max() > off.most
        )
        rejected = jnp.where(
            wrong, LEFT_OUT_FOR, jnp.maximum(belief.rejected[number] - self.period, 0.0)
        )
        believed = rejected <= 0.0
        # the load may be another one now
        doubt = jnp.where((surprise > STRANGE) & believed, change, 0.0) ** 2
        covariance = belief.covariance.at[0, 0].add(doubt)
        spread = spread + doubt * jnp.outer(slopes[:, 0], slopes[:, 0])
        mean, covariance = _corrected(
            belief.mean, covariance, jnp.where(believed, slopes, 0.0), spread, numbers
        )
        return belief._replace(
            mean=mean,
            covariance=covariance,
            strange=belief.strange.at[number].set(strange),
            rejected=belief.rejected.at[number].set(rejected),
        )

    def _against(
        self, belief: Belief, number: int, sense: Sense, off: Off, by_load: Array
    ) -> tuple[Array, ...]:
        """What is heard against what is believed, its slopes by all that is believed, and which of it is heard."""
        # NaN is not
        bends = belief.calming.size
        heard = jnp.abs(off.numbers) < ABSURD
        # what is told late tells of leans, not of the swing
        at = 1 if sense.slow else 1 + bends
        slopes = (
            jnp.zeros((len(off.numbers), len(belief.mean)))
            .at[:, at : at + bends]
            .set(off.slopes)
        )
        numbers = off.numbers
        if sense.slow:
            slopes = slopes.at[:, 0].set(off.slopes @ by_load)
        zeros = self.zeros_of(number, bends)
        if zeros.start < zeros.stop:
            slopes = slopes.at[:, zeros].set(jnp.eye(len(numbers)))
            numbers = numbers - belief.mean[zeros]
        return (
            jnp.where(heard, numbers, 0.0),
            jnp.where(heard[:, None], slopes, 0.0),
            heard,
        )

    def _unless_hung(
        self, belief: Belief, numbers: Array, spread: Array, hung: Array
    ) -> tuple[Array, Array]:
        """A load that may have been hung on or taken off [kg], and what it would leave unexplained."""
        weighed = jnp.linalg.solve(spread, hung)
        change = (
            float(self.estimates)
            * (weighed @ numbers)
            / (weighed @ hung + 1.0 / self.mass**2)
        )
        change = jnp.clip(
            change, -belief.mean[0], MAX_LOAD * self.mass - belief.mean[0]
        )
        return change, numbers - hung * change

    def _strange(
        self, belief: Belief, number: int, surprise: Array, heard: Array
    ) -> Float[Array, ""]:
        """How strange a sense is of late."""
        share = jnp.where(heard.any(), jnp.minimum(self.period / SETTLING, 1.0), 0.0)
        return belief.strange[number] + share * (surprise - belief.strange[number])

    def _within(self, belief: Belief) -> Belief:
        """Loads are none or more, and leans no more than can be."""
        bends = belief.calming.size
        mean = belief.mean
        load = jnp.clip(mean[0], 0.0, MAX_LOAD * self.mass)
        leans = limit_lengths(mean[1 : 1 + bends].reshape(-1, 2), MAX_LEAN).reshape(-1)
        leans = leans * jnp.minimum(
            1.0, self.yields / jnp.maximum(self.push(leans), 1e-9)
        )
        mean = jnp.concatenate([load[None], leans, mean[1 + bends :]])
        return belief._replace(mean=mean)

    def push(self, leans: Float[Array, " bends"]) -> Float[Array, ""]:
        """Force at the tip that would make the modules lean so [N]."""
        return jnp.linalg.norm(self.gains.forces @ leans)

    def _calmed(self, belief: Belief, aimed: Float[Array, "modules 2"]) -> Belief:
        """With what is asked for beside the plan, so that the arm swings less about where the last plan aimed."""
        if not self.calming:
            return belief._replace(rests=aimed)
        bends = aimed.size
        rates = (aimed - belief.rests).reshape(-1) / self.period
        off = belief.mean[1 + bends : 1 + 3 * bends] - jnp.concatenate(
            [aimed.reshape(-1), rates]
        )
        asked = -(self.gains.at(belief.mean[0])[2] @ off).reshape(-1, 2)
        return belief._replace(calming=limit_lengths(asked, MAX_CALMING), rests=aimed)


def _corrected(
    mean: Float[Array, " n"],
    covariance: Float[Array, "n n"],
    slopes: Array,
    spread: Array,
    numbers: Array,
) -> tuple[Array, Array]:
    """Kalman's step."""
    gain = jnp.linalg.solve(spread, slopes @ covariance).T
    covariance = covariance - gain @ slopes @ covariance
    return mean + gain @ numbers, (covariance + covariance.T) / 2.0


def _surprise(
    numbers: Float[Array, " n"], spread: Float[Array, "n n"], heard: Array
) -> Float[Array, ""]:
    """In standard deviations; what is absurd is forgotten as soon as the rest."""
    squared = jnp.sum(numbers**2 / jnp.diag(spread)) / jnp.maximum(heard.sum(), 1)
    return jnp.minimum(jnp.sqrt(squared), 2.0 * STRANGE)


def _pushed(history: Array, newest: Array) -> Array:
    return jnp.concatenate([newest[None], history[:-1]])
