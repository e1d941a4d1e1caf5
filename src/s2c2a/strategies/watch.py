"""What a strategy knows of its arm beside what encoders say: an observer, what it hears, and what it believes."""

from typing import Any

import jax
import numpy as np
from jaxtyping import Array, Float

from s2c2a.arm import ArmSpec
from s2c2a.estimation import Belief, Listener, Observer
from s2c2a.kinematics import ForwardModel
from s2c2a.planning import Plan, Planner
from s2c2a.compilation import compiled, where_finite
from s2c2a.spaces import Reading

NOTHING = np.zeros((), np.float32)
FIRST = 3  # times that a load that is told and the shape under it are brought together


class Watch:
    """An observer at work. Nothing compiles after the first step.

    Attributes:
        observer: that is at work.
    """

    def __init__(self, arm: ArmSpec, planner: Planner, observer: Observer, load: float):
        """For the plans of one planner."""
        self.observer = observer
        self._load = np.float32(load)
        self._listener = Listener(arm, observer.sensors)
        self._forces = np.asarray(observer.gains.forces, float)
        self._start = compiled(_started, planner.model, observer)
        self._update = compiled(_updated, planner.model, observer)
        self._count_on = compiled(_counting_on, planner.model)
        self._belief: Any = None  # a Belief once it has begun

    def begun(self, plan: Plan) -> Plan:
        """A plan of an arm at rest that counts on what is told of it."""
        self._listener.begin()
        plan, self._belief = self._start(plan, self._load)
        return plan

    def seen(
        self, plan: Plan, sensed: Float[Array, "modules 3"], reading: Reading
    ) -> tuple[Plan, Array | np.ndarray]:
        """A plan that counts on what one more reading says, and bends to ask for beside what is planned [rad]."""
        if self.observer.sensors:
            plan, self._belief = self._update(
                plan, self._belief, sensed, self._listener.heard(reading)
            )
        elif self._load > 0.0:
            plan = self._count_on(plan, self._belief, sensed)
        return plan, self._belief.calming if self.observer.sensors else NOTHING

    def diagnostics(self) -> dict[str, np.ndarray]:
        """Load [kg], leans [rad], the push they stand for [N], sensors that are left out, by column of an episode."""
        belief: Belief = self._belief
        load, leans = (np.asarray(part, float) for part in belief.disturbances)
        told: dict[str, Any] = {"load": load, "bend_biases": leans}
        if self.observer.sensors:
            told["push"] = np.linalg.norm(self._forces @ leans.reshape(-1))
        rejected = {
            f"rejected.{sense.name}": belief.rejected[k] > 0
            for k, sense in enumerate(self.observer.sensors)
        }
        return told | {
            name: np.asarray(value, float) for name, value in rejected.items()
        }


def _started(
    model: ForwardModel, observer: Observer, plan: Plan, load: Array
) -> tuple[Plan, Belief]:
    configurations = plan.configurations
    memory = plan.memory
    disturbances = observer.start(
        model.predict(configurations, memory), load
    ).disturbances
    memory = jax.lax.fori_loop(
        0,
        FIRST,
        lambda _, known: model.given(disturbances, configurations, known),
        memory,
    )
    return plan._replace(memory=memory), observer.start(
        model.predict(configurations, memory), load
    )


def _updated(
    model: ForwardModel,
    observer: Observer,
    plan: Plan,
    belief: Belief,
    sensed: Array,
    said: dict[str, Array],
) -> tuple[Plan, Belief]:
    """Plan and belief after one more reading; those of before where anything is not finite, for it would stay."""
    believed = observer.update(
        belief, model, plan.memory, sensed, plan.configurations, said
    )
    belief, memory = where_finite(believed, (belief, plan.memory))
    return plan._replace(memory=memory), belief


def _counting_on(
    model: ForwardModel, plan: Plan, belief: Belief, sensed: Array
) -> Plan:
    """A plan that counts on what is believed, where the arm is now."""
    return plan._replace(memory=model.given(belief.disturbances, sensed, plan.memory))
