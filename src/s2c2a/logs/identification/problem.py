"""Residuals of a fit: differences between recorded and simulated states."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float
from pydantic import ValidationError
from scipy.spatial.transform import Rotation

from s2c2a.arm import ArmSpec
from s2c2a.arm.geometry import per_module
from s2c2a.data import Recording
from s2c2a.episodes import Episode
from s2c2a.errors import RecordingError, S2C2AError, SimulationError
from s2c2a.logs.identification.numbers import Unknown, arm_at
from s2c2a.logs.identification.replay import Replay, replayed
from s2c2a.spaces import AXIS, POSITION, States

EXPECTED = 0.01  # typical residual of a good fit, relative to the arm's length
FAILED = 100.0  # residual of an arm that is invalid or diverges, in typical ones
# prior standard deviation of the recording's frame: rotation [rad], and shift relative
# to the arm's length
FRAME_SPREAD = np.array([0.1, 0.1, 0.1, 0.05, 0.05, 0.05])
FRAME_NAMES = tuple(
    f"frame.{kind}_{axis}" for kind in ("turn", "shift") for axis in "xyz"
)
MAX_SETTLING = 60.0  # s
# every fifth block of 25 rows is held out
HELD_OUT = 5
BLOCK = 25


@dataclass(frozen=True)
class IdentificationOptions:
    """Options of a fit.

    Attributes:
        replay: options of the replay.
        frame: whether to fit the recording's frame, as for an imported recording.
        rounds: largest number of Jacobians.
    """

    replay: Replay = field(default_factory=Replay)
    frame: bool = False
    rounds: int = 12


def options_for(
    recording: Recording, settling: float | None, rounds: int, fidelity: str
) -> IdentificationOptions:
    """Options for a recording.

    The frame of an imported recording may be wrong, and its episodes are continuous.

    Args:
        recording: recording to fit.
        settling: time to hold each action if rows are poses at rest [s].
        rounds: rounds of the fit.
        fidelity: fidelity of the simulation.

    Raises:
        S2C2AError: a number is out of range.
    """
    if rounds < 1:
        raise S2C2AError(f"{rounds} rounds are too few; choose at least 1")
    if settling is not None and not 0 < settling <= MAX_SETTLING:
        raise S2C2AError(
            f"settling of {settling} s is out of range; choose a time above 0 s and up "
            f"to {MAX_SETTLING:g} s"
        )
    imported = str(recording.options.get("babbling", "")).startswith("imported")
    return IdentificationOptions(Replay(settling, imported, fidelity), imported, rounds)


@dataclass(frozen=True, eq=False)
class FitProblem:
    """Data and unknowns of a fit; it can be sent to other processes.

    Attributes:
        arm: start of the fit.
        unknowns: numbers of the arm to fit.
        episodes: recorded episodes.
        measured: states to fit; NaN where they are not measured or held out.
        options: options of the fit.
    """

    arm: ArmSpec
    unknowns: tuple[Unknown, ...]
    episodes: tuple[Episode, ...]
    measured: tuple[States, ...]
    options: IdentificationOptions

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the coordinates."""
        names = tuple(unknown.name for unknown in self.unknowns)
        return names + FRAME_NAMES if self.options.frame else names


def build_problem(
    arm: ArmSpec,
    unknowns: Sequence[Unknown],
    episodes: Sequence[Episode],
    options: IdentificationOptions,
) -> FitProblem:
    """Problem without the rows of `held_out`.

    Raises:
        RecordingError: no state is measured.
    """
    excluded = held_out(episodes, options.replay.one_take)
    measured = tuple(
        np.where(rows[:, None, None], np.nan, episode.sensor("states"))
        for rows, episode in zip(excluded, episodes, strict=True)
    )
    if not any(np.isfinite(states).any() for states in measured):
        raise RecordingError(
            "the recording has no measured states, so there is nothing to fit; "
            "record the sensor `states`"
        )
    return FitProblem(arm, tuple(unknowns), tuple(episodes), measured, options)


def held_out(episodes: Sequence[Episode], one_take: bool = False) -> list[np.ndarray]:
    """Rows that are held out from the fit: every fifth block of 25 in all episodes.

    The first row of every episode (in one take: of the first one) is held out too,
    because its history is unknown. Shapes (rows,).
    """
    ends = np.cumsum([len(episode) for episode in episodes])
    blocks = np.arange(ends[-1]) // BLOCK
    excluded = np.split(blocks % HELD_OUT == HELD_OUT - 1, ends[:-1])
    first = first_rows(episodes, one_take)
    return [rows | unknown for rows, unknown in zip(excluded, first, strict=True)]


def first_rows(episodes: Sequence[Episode], one_take: bool = False) -> list[np.ndarray]:
    """Rows with an unknown history, which are not evaluated; shapes (rows,)."""
    masks = []
    for number, episode in enumerate(episodes):
        mask = np.zeros(len(episode), bool)
        mask[:1] = number == 0 or not one_take
        masks.append(mask)
    return masks


def coordinate_bounds(problem: FitProblem) -> tuple[np.ndarray, np.ndarray]:
    """Smallest and largest coordinates, widened so that the start is inside."""
    size = len(problem.names)
    low = np.full(size, -np.inf)
    high = np.full(size, np.inf)
    for index, unknown in enumerate(problem.unknowns):
        low[index], high[index] = unknown.bounds
    return np.minimum(low, -1e-9), np.maximum(high, 1e-9)


def residuals(
    problem: FitProblem, coordinates: Float[np.ndarray, " coordinates"]
) -> Float[np.ndarray, " measured"]:
    """Differences of states, in typical ones; large values if the simulation fails."""
    states = simulate(problem, coordinates[: len(problem.unknowns)])
    return residuals_of(problem, coordinates, states)


def simulate(
    problem: FitProblem, coordinates: Float[np.ndarray, " unknowns"]
) -> list[States] | None:
    """States of the arm at these coordinates; None if it is invalid or diverges."""
    try:
        arm = arm_at(problem.arm, problem.unknowns, coordinates)
        return replayed(arm, problem.episodes, problem.options.replay)
    except (SimulationError, ValidationError):
        return None


def residuals_of(
    problem: FitProblem,
    coordinates: Float[np.ndarray, " coordinates"],
    states: list[States] | None,
) -> Float[np.ndarray, " measured"]:
    """Residuals of simulated states, which do not depend on the recording's frame."""
    measured = np.concatenate(problem.measured)
    known = np.isfinite(measured)
    if states is None:
        return np.full(known.sum(), FAILED)
    predicted = to_recording_frame(problem, coordinates, np.concatenate(states))
    errors = predicted - measured
    expected = EXPECTED * problem.arm.length
    errors[..., POSITION] /= expected
    errors[..., AXIS] *= per_module(problem.arm, "length").mean() / expected
    return errors[known]


def to_recording_frame(
    problem: FitProblem, coordinates: np.ndarray, states: States
) -> States:
    """States in the recording's frame, from those in the base frame."""
    if not problem.options.frame:
        return states
    frame = FRAME_SPREAD * coordinates[len(problem.unknowns) :]
    rotation = Rotation.from_rotvec(frame[:3]).as_matrix()
    offset = frame[3:] * problem.arm.length
    positions = states[..., POSITION] @ rotation.T + offset
    axes = states[..., AXIS] @ rotation.T
    return np.concatenate([positions, axes], axis=-1)
