"""Loads that were hung at arms of metal after their networks were trained: found in their recordings, or not.

The observer is fed with what encoders say, and for the first seconds with where the tip was seen; then it goes blind.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmSpec
from s2c2a.arm.senses import Camera, Senses
from s2c2a.data import Recording
from s2c2a.errors import RecordingError
from s2c2a.estimation import Observer
from s2c2a.evaluation.report import Row, over_seeds
from s2c2a.kinematics import ForwardModel
from s2c2a.programs import compiled
from s2c2a.spaces import POSITION
from s2c2a.strategies import Recipe, TrainedNetworks, observer_of, training_data

EXPERIMENT = "loads"
NOBODY, FOUND = "nobody tells", "found"


@dataclass(frozen=True)
class Believed:
    """Of one episode, step by step.

    Attributes:
        tips: where the tip is expected [m], shape (steps, 3).
        loads: at it [kg], shape (steps,).
    """

    tips: Float[np.ndarray, "steps 3"]
    loads: Float[np.ndarray, " steps"]


def load_rows(networks: TrainedNetworks[Recipe], recordings: Mapping[str, Recording], seen: float) -> Iterator[Row]:
    """How far the tip is from where it is expected once nothing sees it any more, and the load that was found.

    Args:
        networks: trained without load.
        recordings: of the same arm with something at its tip, by name.
        seen: for how long the tip is seen [s].

    Raises:
        RecordingError: a recording of another arm, or too short.
    """
    arm = networks.arm
    for name, recording in recordings.items():
        if (recording.arm.module_count, recording.arm.cable_count) != (arm.module_count, arm.cable_count):
            raise RecordingError(f"{name} is of {recording.arm.name}, and the networks are of {arm.name}")
        if min(recording.lengths) <= seen * arm.control_rate + 1:
            raise RecordingError(f"{name} has episodes that end before the tip was seen for {seen:g} s; say less")
        for said, seconds in ((NOBODY, 0.0), (FOUND, seen)):
            every = [believed(networks, recording, one, seconds) for one in range(len(recording.lengths))]
            yield from _rows(networks, name, said, recording, every, round(seen * arm.control_rate))


def believed(networks: TrainedNetworks[Recipe], recording: Recording, episode: int, seen: float) -> Believed:
    """What comes of one episode of a recording, whose tip is seen for so long [s]."""
    arm, steps = networks.arm, recording.lengths[episode]
    observer = observer_of(replace(networks, arm=_with_tip_seen(arm)))
    sensed = training_data(recording, networks.recipe).sensed[episode, :steps].astype(np.float32)
    tips = recording.sensor("states")[episode, :steps, -1, POSITION]
    begin, follow = (compiled(part, networks.c2s, observer) for part in (_begun, _followed))
    belief, memory = begin(sensed[0])
    expected, loads = np.empty((steps, 3)), np.empty(steps)
    for step in range(steps):
        said = np.full((arm.module_count, 3), np.nan, np.float32)
        if step < seen * arm.control_rate:
            said[-1] = tips[step]
        heard = {"seen": said, "seen_age": np.zeros((), np.float32)}
        expected[step], belief, memory = follow(belief, memory, sensed[step], heard)
        loads[step] = belief.mean[0]
    return Believed(expected, loads)


def _begun(model: ForwardModel, observer: Observer, sensed: jax.Array):
    memory = model.start(sensed)
    return observer.start(model.predict(sensed, memory), jnp.zeros(())), memory


def _followed(model: ForwardModel, observer: Observer, belief, memory, sensed: jax.Array, said):
    memory = model.observe(sensed, memory)
    belief, memory = observer.update(belief, model, memory, sensed, sensed, said)
    return model.predict(sensed, memory)[-1, POSITION], belief, memory


def _with_tip_seen(arm: ArmSpec) -> ArmSpec:
    camera = Camera(rate=arm.control_rate, delay=0.0, lost=0.0)
    return arm.model_copy(update={"senses": Senses(camera=camera)})


def _rows(
    networks: TrainedNetworks[Recipe], name: str, said: str, recording: Recording, every: list[Believed], first: int
) -> Iterator[Row]:
    """Of one recording, from a step on."""
    off, loads = [], []
    for one, (found, steps) in enumerate(zip(every, recording.lengths, strict=True)):
        tips = recording.sensor("states")[one, :steps, -1, POSITION]
        off.append(1000 * np.linalg.norm(found.tips - tips, axis=-1)[first:])
        loads.append(1000 * found.loads[-1])
    distances = np.concatenate(off)
    heading = EXPERIMENT, name, networks.arm.name, "real", said, networks.recipe.name
    far = over_seeds([float(np.nanmean(distances))], [float(np.nanstd(distances))])
    yield Row(*heading, "position", "mm", **far, seeds=(networks.seed,))
    yield Row(*heading, "load", "g", **over_seeds([float(np.mean(loads))]), seeds=(networks.seed,))
