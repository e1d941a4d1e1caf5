"""Payload estimation in recordings of real arms.

The networks were trained without payload. The state estimator uses encoders, and for the
first seconds the position of the tip; then it has encoders alone.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from s2c2a.arm.sensors import Camera, Sensors
from s2c2a.data import Recording
from s2c2a.errors import RecordingError, counted
from s2c2a.estimation import DisturbanceFilter, KalmanEstimator
from s2c2a.estimation.filter_state import FilterState
from s2c2a.estimation.sensor_models import CameraSensor, Measurements
from s2c2a.evaluation.report import Row, over_seeds
from s2c2a.execution.compilation import compiled
from s2c2a.spaces import POSITION
from s2c2a.strategies import TrainedNetworks, estimator_of, training_data

SEEN = 20.0  # s, in which the tip position is measured
EXPERIMENT = "payloads"
WITHOUT = "without estimation"
ESTIMATED = "estimated"
# m; smaller than in closed loop, since no controller reacts to the estimate
POSITION_STD = 0.02


@dataclass(frozen=True)
class EstimatedEpisode:
    """Estimates along one episode.

    Attributes:
        tips: predicted tip positions [m], shape (steps, 3).
        payloads: estimated [kg], shape (steps,).
    """

    tips: Float[np.ndarray, "steps 3"]
    payloads: Float[np.ndarray, " steps"]


def payload_rows(
    networks: TrainedNetworks,
    recordings: Mapping[str, Recording],
    seconds: float,
    keep: Callable[[list[Row]], object] = lambda rows: None,
) -> list[Row]:
    """Prediction error after the tip is no longer measured, and the estimated payload.

    Args:
        networks: trained without payload.
        recordings: of the same arm with a payload, by name.
        seconds: for which the tip is measured.
        keep: called with all rows so far whenever a recording is finished, so that an
            interruption loses none.

    Raises:
        RecordingError: no recording, one of another arm, or one that is too short.
    """
    if seconds <= 0.0 or not recordings:
        raise RecordingError(
            f"{counted(len(recordings), 'recording')} and {seconds:g} s were given; "
            "give at least one recording and a positive time"
        )
    steps = round(seconds * networks.arm.control_rate)
    disturbance_filter = _filter(networks)
    for name, recording in recordings.items():
        arm = networks.arm
        recorded = (recording.arm.module_count, recording.arm.cable_count)
        if recorded != (arm.module_count, arm.cable_count):
            raise RecordingError(
                f"{name} is of {recording.arm.name}, and the networks are of {arm.name}"
            )
        if min(recording.lengths) <= steps + 1:
            raise RecordingError(
                f"{name} has episodes that are shorter than the "
                f"{counted(steps, 'step')} in which the tip is measured; give a shorter time"
            )
    rows: list[Row] = []
    for name, recording in recordings.items():
        rows += _recording_rows(networks, disturbance_filter, name, recording, steps)
        keep(rows)
    return rows


def _recording_rows(
    networks: TrainedNetworks,
    disturbance_filter: DisturbanceFilter,
    name: str,
    recording: Recording,
    steps: int,
) -> Iterator[Row]:
    """Rows of one recording, without and with estimation."""
    sensed = training_data(recording, networks.recipe).sensed
    tips = recording.sensor("states")[:, :, -1, POSITION]
    for label, measured_steps in ((WITHOUT, 0), (ESTIMATED, steps)):
        episodes = [
            estimate_episode(
                disturbance_filter,
                sensed[number, :length],
                tips[number, :length],
                measured_steps,
            )
            for number, length in enumerate(recording.lengths)
        ]
        yield from _rows(networks, name, label, tips, episodes, steps)


def _filter(networks: TrainedNetworks) -> DisturbanceFilter:
    """The filter of an arm whose tip is measured in every control step.

    Raises:
        RecordingError: the recipe estimates no payload.
    """
    camera = Camera(rate=networks.arm.control_rate, delay=0.0, lost=0.0)
    arm = networks.recipe.seen_arm(networks.arm)
    arm = arm.model_copy(update={"sensors": Sensors(camera=camera)})
    estimator = estimator_of(replace(networks, arm=arm))
    if not isinstance(estimator, KalmanEstimator):
        raise RecordingError(
            f"recipe '{networks.recipe.name}' estimates no payload; train with one whose "
            "estimator is KalmanFilter"
        )
    sensors = tuple(
        replace(sensor, std=POSITION_STD)
        for sensor in estimator.filter.sensors
        if isinstance(sensor, CameraSensor)
    )
    return replace(estimator.filter, sensors=sensors)


def estimate_episode(
    disturbance_filter: DisturbanceFilter,
    sensed: Float[np.ndarray, "steps modules 3"],
    tips: Float[np.ndarray, "steps 3"],
    measured_steps: int,
) -> EstimatedEpisode:
    """Run the filter along one episode.

    Args:
        disturbance_filter: with a camera on the tip.
        sensed: configurations by the encoders.
        tips: true tip positions [m].
        measured_steps: for which the tip is measured.
    """
    start = compiled(_start, disturbance_filter)
    update = compiled(_update, disturbance_filter)
    sensed = sensed.astype(np.float32)
    state = start(sensed[0])
    predicted = np.empty_like(tips)
    payloads = np.empty(len(tips))
    for step, configuration in enumerate(sensed):
        positions = np.full((sensed.shape[1], 3), np.nan, np.float32)
        if step < measured_steps:
            positions[-1] = tips[step]
        measurements = {
            "camera_positions": positions,
            "camera_age": np.zeros((), np.float32),
        }
        state, predicted[step] = update(state, configuration, measurements)
        payloads[step] = state.mean.payload
    return EstimatedEpisode(predicted, payloads)


def _start(disturbance_filter: DisturbanceFilter, configuration) -> FilterState:
    return disturbance_filter.start(configuration, jnp.zeros(()))


def _update(
    disturbance_filter: DisturbanceFilter,
    state: FilterState,
    configuration,
    measurements: Measurements,
):
    """The next state, and the tip that the forward model predicts with it [m]."""
    model = disturbance_filter.model
    before = state.hysteresis
    state = disturbance_filter.update(state, configuration, measurements)
    states = model.predict(configuration, before, state.disturbances)
    return state, states[-1, POSITION]


def _rows(
    networks: TrainedNetworks,
    name: str,
    label: str,
    tips: Float[np.ndarray, "episodes steps 3"],
    episodes: list[EstimatedEpisode],
    first: int,
) -> Iterator[Row]:
    """Rows of one recording, from a step on."""
    errors = []
    for episode, true in zip(episodes, tips, strict=True):
        difference = episode.tips - true[: len(episode.tips)]
        errors.append(np.linalg.norm(difference, axis=-1)[first:])
    distances = 1000 * np.concatenate(errors)
    heading = (
        EXPERIMENT,
        name,
        networks.arm.name,
        "real",
        label,
        networks.recipe.name,
    )
    mean = [float(np.nanmean(distances))]
    std = [float(np.nanstd(distances))]
    seeds = (networks.seed,)
    yield Row(*heading, "position", "mm", **over_seeds(mean, std), seeds=seeds)
    last = [episode.payloads[-1] for episode in episodes]
    payload = 1000 * float(np.mean(last))
    yield Row(*heading, "payload", "g", **over_seeds([payload]), seeds=seeds)
