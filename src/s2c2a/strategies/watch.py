"""What a strategy knows of its arm beside what encoders say: an observer, what it hears, and what it believes."""

from typing import Any

import numpy as np
from jaxtyping import Array, Float

from s2c2a.arm import ArmSpec
from s2c2a.estimation import Belief, Listener, Observer
from s2c2a.kinematics import ForwardModel
from s2c2a.planning import Plan, Planner
from s2c2a.programs import compiled
from s2c2a.spaces import Reading

FIRST = 3  # times that a load that is told and the shape under it are brought together


class Watch:
    """An observer at work. Nothing compiles after the first step."""

    def __init__(self, arm: ArmSpec, planner: Planner, observer: Observer, load: float):
        """For the plans of one planner."""
        self._observer, self._load = observer, np.float32(load)
        self._listener = Listener(arm, observer.senses)
        self._start = compiled(_started, planner.model, observer)
        self._update = compiled(_updated, planner.model, observer)
        self._belief: Belief | None = None

    def begun(self, plan: Plan) -> Plan:
        """A plan of an arm at rest that counts on what is told of it."""
        self._listener.begin()
        plan, self._belief = self._start(plan, self._load)
        return plan

    def seen(self, plan: Plan, sensed: Float[Array, "modules 3"], reading: Reading) -> tuple[Plan, Array | np.ndarray]:
        """A plan that counts on what one more reading says, and bends to ask for beside what is planned [rad]."""
        if not self._observer.senses:
            return plan, np.zeros((), np.float32)
        plan, belief = self._update(plan, self._belief, sensed, self._listener.heard(reading))
        self._belief = belief
        return plan, belief.calming

    def told(self) -> dict[str, np.ndarray]:
        """Load [kg], leans [rad], and which senses are left out, by column of an episode."""
        belief = self._belief
        if belief is None:
            return {}
        load, leans = (np.asarray(part, float) for part in belief.unknowns)
        told: dict[str, Any] = {"load": load, "leans": leans}
        left_out = {f"left_out.{sense.name}": belief.left_out[k] > 0 for k, sense in enumerate(self._observer.senses)}
        return told | {name: np.asarray(value, float) for name, value in left_out.items()}


def _started(model: ForwardModel, observer: Observer, plan: Plan, load: Array) -> tuple[Plan, Belief]:
    configurations, memory = plan.configurations, plan.memory
    unknowns = observer.start(model.predict(configurations, memory), load).unknowns
    for _ in range(FIRST):
        memory = model.given(unknowns, configurations, memory)
    return plan._replace(memory=memory), observer.start(model.predict(configurations, memory), load)


def _updated(
    model: ForwardModel, observer: Observer, plan: Plan, belief: Belief, sensed: Array, said: dict[str, Array]
) -> tuple[Plan, Belief]:
    belief = observer.update(belief, model, plan.memory, sensed, plan.configurations, said)
    return plan._replace(memory=model.given(belief.unknowns, sensed, plan.memory)), belief
