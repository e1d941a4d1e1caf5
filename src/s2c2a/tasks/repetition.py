"""Iterative learning control: a repeated task moves its targets by measured errors.

The offset of every target after repetition k is (D. A. Bristow, M. Tharayil and A. G.
Alleyne, A survey of iterative learning control, IEEE Control Systems 26(3), 2006)

    offset_{k+1}(t) = offset_k(t) + LEARNING_GAIN * smoothed error_k(t + LEAD_TIME)

with errors of the module ends as a sensor saw them. Smoothing over time is the filter
that keeps noise, lost pictures and vibration out of the offsets. The lead is the time
that the arm takes to follow its targets.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from s2c2a.arm.geometry import interpolated
from s2c2a.episodes import Episode
from s2c2a.errors import S2C2AError
from s2c2a.robots import Robot
from s2c2a.spaces import POSITION
from s2c2a.tasks.task import Task

LEARNING_GAIN = 0.5  # of an error: half of the noise of a measurement at most
LEAD_TIME = 0.1  # s: a control step at 10 Hz, in which the arm follows its targets
SMOOTHING_TIME = 0.5  # s; standard deviation of the smoothing kernel
MAX_OFFSET = 0.15  # of the arm's length; a larger error is no model error
COLUMN = "target_offsets"
"""Of an episode: what was added to the desired positions [m], shape (modules, 3)."""

Offsets = Float[np.ndarray, "steps modules 3"]


def end_sensor(robot: Robot) -> str:
    """Name of the sensor that measures module ends while a task runs.

    Args:
        robot: that repeats a task. The true states of a simulated arm are used only if its
            arm file lists them as sensed.

    Raises:
        S2C2AError: the robot has no such sensor.
    """
    if "camera_positions" in robot.sensors:
        return "camera_positions"
    is_measured = robot.arm.sensing == "true" or not robot.own_time
    if "states" in robot.sensors and is_measured:
        return "states"
    raise S2C2AError(
        f"'{robot.arm.name}' has no sensor that measures its module ends, so repeating "
        "a task cannot improve it; add [sensors.camera] to the arm file, or repeat once"
    )


def moved_task(task: Task, offsets: Offsets) -> Task:
    """The task with offsets [m] added to its desired positions."""
    goals = [
        goal._replace(positions=(goal.positions + offset).astype(np.float32))
        for goal, offset in zip(task.goals, offsets, strict=True)
    ]
    return replace(task, goals=tuple(goals))


def with_true_targets(episode: Episode, task: Task, offsets: Offsets) -> Episode:
    """The episode of a moved task, with the task's own targets and the offsets.

    Its time starts at zero.
    """
    columns = dict(episode.columns)
    running = episode.running
    desired = columns["desired_positions"].copy()
    desired[running] = task.desired_positions()[: len(running)]
    recorded = np.zeros((len(episode), *offsets.shape[1:]))
    recorded[running] = offsets[: len(running)]
    times = columns["time"] - columns["time"][0]
    return replace(
        episode,
        columns=columns
        | {"desired_positions": desired, COLUMN: recorded, "time": times},
    )


def learned_offsets(episode: Episode, offsets: Offsets, sensor: str) -> Offsets:
    """Offsets for the next repetition.

    Args:
        episode: the last repetition, with the task's own targets.
        offsets: of the last repetition [m].
        sensor: that measures the module ends (`end_sensor`).

    Returns:
        Offsets [m], base frame, at most `MAX_OFFSET` of the arm's length; unchanged
        where a module has no target or was not seen.
    """
    moments, ends = _measured_ends(episode, sensor)
    times = episode.times()
    desired = episode.ran("desired_positions")
    learned = offsets.copy()
    for module in range(desired.shape[1]):
        targets = interpolated(moments, times, desired[:, module])
        errors = targets - ends[:, module]
        is_known = np.isfinite(errors).all(axis=-1)
        if is_known.any():
            # average near each time (E. A. Nadaraya 1964), Gaussian weights
            later = (times + LEAD_TIME)[:, None]
            exponents = -0.5 * ((later - moments[is_known]) / SMOOTHING_TIME) ** 2
            # in a gap the nearest samples count, however far they are
            weights = np.exp(exponents - exponents.max(axis=1, keepdims=True))
            smooth = weights @ errors[is_known] / weights.sum(axis=1, keepdims=True)
            learned[: len(times), module] += LEARNING_GAIN * smooth
    longest = MAX_OFFSET * episode.arm.length
    lengths = np.linalg.norm(learned, axis=-1, keepdims=True)
    return learned * np.minimum(1.0, longest / np.maximum(lengths, 1e-12))


def _measured_ends(
    episode: Episode, sensor: str
) -> tuple[Float[np.ndarray, " samples"], Float[np.ndarray, "samples modules 3"]]:
    """When module ends were measured [s], and where they were [m].

    Measurements before and after the run are left out.
    """
    positions = episode.sensor(sensor)[..., POSITION]
    moments = np.array(episode["time"], float)
    if sensor == "camera_positions" and "camera_age" in episode.sensors:
        moments = moments - episode.sensor("camera_age")
    times = episode.times()
    is_used = (moments >= times[0]) & (moments <= times[-1])
    is_used &= np.isfinite(positions).any(axis=(1, 2))
    # a picture that is read twice counts once
    moments, first = np.unique(moments[is_used], return_index=True)
    return moments, positions[is_used][first]
