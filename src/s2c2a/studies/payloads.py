"""Loads that were hung at arms of metal after their networks were trained: found in their recordings, or not.

The observer is fed with what encoders say, and for the first seconds with where the tip
was seen; then it goes blind.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmSpec
from s2c2a.arm.sensors import Camera, Sensors
from s2c2a.data import Recording
from s2c2a.errors import RecordingError
from s2c2a.estimation import Observer
from s2c2a.estimation.sensors import SeenEnds
from s2c2a.evaluation.report import Row, over_seeds
from s2c2a.kinematics import ForwardModel
from s2c2a.compilation import compiled
from s2c2a.spaces import POSITION
from s2c2a.strategies import Recipe, TrainedNetworks, observer_of, training_data

EXPERIMENT = "loads"
NOBODY = "nobody tells"
FOUND = "found"
# m; of a tip that is seen: nothing is driven by what is found, so it need not be found
# slowly
SPREAD = 0.02


@dataclass(frozen=True)
class Believed:
    """Of one episode, step by step.

    Attributes:
        tips: where the tip is expected [m], shape (steps, 3).
        loads: at it [kg], shape (steps,).
    """

    tips: Float[np.ndarray, "steps 3"]
    loads: Float[np.ndarray, " steps"]


def load_rows(
    networks: TrainedNetworks[Recipe], recordings: Mapping[str, Recording], seen: float
) -> Iterator[Row]:
    """How far the tip is from where it is expected once nothing sees it any more, and the load that was found.

    Args:
        networks: trained without load.
        recordings: of the same arm with something at its tip, by name.
        seen: for how long the tip is seen [s].

    Raises:
        RecordingError: a recording of another arm, or too short.
    """
    arm = networks.arm
    first = round(seen * networks.arm.control_rate)
    if seen <= 0.0 or not recordings:
        raise RecordingError(
            f"{len(recordings)} recordings and {seen:g} s asked for; give one, and some seconds"
        )
    if not networks.recipe.observes:
        raise RecordingError(
            f"recipe '{networks.recipe.name}' takes no notice of loads; train with one that observes"
        )
    observer = observer_of(
        replace(networks, arm=_with_tip_seen(networks.recipe.felt(arm)))
    )
    eyes = (
        replace(sense, spread=SPREAD)
        for sense in observer.sensors
        if isinstance(sense, SeenEnds)
    )
    observer = replace(observer, sensors=tuple(eyes))
    for name, recording in recordings.items():
        if (recording.arm.module_count, recording.arm.cable_count) != (
            arm.module_count,
            arm.cable_count,
        ):
            raise RecordingError(
                f"{name} is of {recording.arm.name}, and the networks are of {arm.name}"
            )
        if min(recording.lengths) <= seen * arm.control_rate + 1:
            raise RecordingError(
                f"{name} has episodes that end before the tip was seen for {seen:g} s; say less"
            )
        sensed = training_data(recording, networks.recipe).sensed
        tips = recording.sensor("states")[:, :, -1, POSITION]
        for label, steps in ((NOBODY, 0), (FOUND, first)):
            every = [
                believed(
                    networks.c2s,
                    observer,
                    sensed[one, :length],
                    tips[one, :length],
                    steps,
                )
                for one, length in enumerate(recording.lengths)
            ]
            yield from _rows(networks, name, label, tips, every, first)


def believed(
    model: ForwardModel,
    observer: Observer,
    sensed: Float[np.ndarray, "steps modules 3"],
    tips: Float[np.ndarray, "steps 3"],
    seen: int,
) -> Believed:
    """What comes of one episode, whose tip is seen for so many steps.

    Args:
        model: of the arm without load.
        observer: that hears where the tip is.
        sensed: configurations, by encoders.
        tips: where the tip was [m].
        seen: steps.
    """
    begin, follow = (compiled(part, model, observer) for part in (_begun, _followed))
    sensed = sensed.astype(np.float32)
    belief, memory = begin(sensed[0])
    expected = np.empty_like(tips)
    loads = np.empty(len(tips))
    for step, now in enumerate(sensed):
        said = np.full((sensed.shape[1], 3), np.nan, np.float32)
        if step < seen:
            said[-1] = tips[step]
        heard = {"camera_positions": said, "camera_age": np.zeros((), np.float32)}
        expected[step], belief, memory = follow(belief, memory, now, heard)
        loads[step] = belief.mean[0]
    return Believed(expected, loads)


def _begun(model: ForwardModel, observer: Observer, sensed: jax.Array):
    memory = model.start(sensed)
    return observer.start(model.predict(sensed, memory), jnp.zeros(())), memory


def _followed(
    model: ForwardModel, observer: Observer, belief, memory, sensed: jax.Array, said
):
    memory = model.observe(sensed, memory)
    belief, memory = observer.update(belief, model, memory, sensed, sensed, said)
    return model.predict(sensed, memory)[-1, POSITION], belief, memory


def _with_tip_seen(arm: ArmSpec) -> ArmSpec:
    camera = Camera(rate=arm.control_rate, delay=0.0, lost=0.0)
    return arm.model_copy(update={"sensors": Sensors(camera=camera)})


def _rows(
    networks: TrainedNetworks[Recipe],
    name: str,
    label: str,
    tips: np.ndarray,
    every: list[Believed],
    first: int,
) -> Iterator[Row]:
    """Of one recording, from a step on."""
    off = [
        np.linalg.norm(found.tips - true[: len(found.tips)], axis=-1)
        for found, true in zip(every, tips, strict=True)
    ]
    distances = 1000 * np.concatenate([one[first:] for one in off])
    heading = EXPERIMENT, name, networks.arm.name, "real", label, networks.recipe.name
    far = over_seeds([float(np.nanmean(distances))], [float(np.nanstd(distances))])
    yield Row(*heading, "position", "mm", **far, seeds=(networks.seed,))
    load = 1000 * float(np.mean([found.loads[-1] for found in every]))
    yield Row(*heading, "load", "g", **over_seeds([load]), seeds=(networks.seed,))
