"""What a recording asks of an arm: differences between what it did and what the simulated one does."""

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
from s2c2a.identification.numbers import Unknown, arm_at
from s2c2a.identification.replay import Replay, replayed
from s2c2a.spaces import AXIS, POSITION, States

EXPECTED = 0.01  # of the arm's length: residual of a twin that is worth its name
FAILED = 100.0  # residual of an arm that cannot be or blows up, in what is expected
# rad, and parts of the length: how far off the recording's frame is
FRAME_SPREAD = np.array([0.1] * 3 + [0.05] * 3)
FRAME_NAMES = tuple(
    f"frame.{what}_{axis}" for what in ("turn", "shift") for axis in "xyz"
)
LONGEST_SETTLING = 60.0  # s
# every fifth stretch of 25 rows is kept from the fit
HELD_OUT = 5
STRETCH = 25


@dataclass(frozen=True)
class FitOptions:
    """How it is fitted.

    Attributes:
        replay: how the recording is gone through again.
        frame: whether the recording's frame may be off too, as that of an imported one.
        rounds: Jacobians at most.
    """

    replay: Replay = field(default_factory=Replay)
    frame: bool = False
    rounds: int = 12


def options_for(
    recording: Recording, settling: float | None, rounds: int, fidelity: str
) -> FitOptions:
    """What suits a recording: an imported one may be registered wrongly, and its episodes follow each other.

    Args:
        recording: that is fitted to.
        settling: seconds that an action is held, where rows are shapes at rest.
        rounds: of the fit.
        fidelity: of the simulation.

    Raises:
        S2C2AError: numbers that are not positive.
    """
    if rounds < 1 or (settling is not None and not 0 < settling <= LONGEST_SETTLING):
        raise S2C2AError(
            f"{rounds} rounds and {settling} s to settle asked for; take at least one round, and up to "
            f"{LONGEST_SETTLING:g} s"
        )
    imported = str(recording.options.get("babbling", "")).startswith("imported")
    return FitOptions(Replay(settling, imported, fidelity), imported, rounds)


@dataclass(frozen=True, eq=False)
class Problem:
    """What is to be explained, by which numbers; it travels to other processes.

    Attributes:
        arm: the start.
        unknowns: its numbers that are fitted.
        episodes: what was recorded.
        seen: states that the fit shall explain; NaN where nothing was seen or rows are
            kept from it.
        options: how.
    """

    arm: ArmSpec
    unknowns: tuple[Unknown, ...]
    episodes: tuple[Episode, ...]
    seen: tuple[States, ...]
    options: FitOptions

    @property
    def names(self) -> tuple[str, ...]:
        """Of the coordinates."""
        return tuple(one.name for one in self.unknowns) + (
            FRAME_NAMES if self.options.frame else ()
        )


def problem_of(
    arm: ArmSpec,
    unknowns: Sequence[Unknown],
    episodes: Sequence[Episode],
    options: FitOptions,
) -> Problem:
    """What is to be explained, without what `held_out` keeps.

    Raises:
        RecordingError: no state was seen.
    """
    kept = held_out(episodes, options.replay.one_session)
    seen = tuple(
        np.where(rows[:, None, None], np.nan, one.sensor("states"))
        for rows, one in zip(kept, episodes, strict=True)
    )
    if not any(np.isfinite(one).any() for one in seen):
        raise RecordingError(
            "nothing was seen of this arm's ends, so nothing can be fitted; record `states` too"
        )
    return Problem(arm, tuple(unknowns), tuple(episodes), seen, options)


def held_out(
    episodes: Sequence[Episode], one_session: bool = False
) -> list[np.ndarray]:
    """Which rows are kept from the fit: every fifth stretch of 25, counted through all episodes; shapes (rows,).

    Beside them the first row of every episode, since what came before it is not known;
    in one session of the first.
    """
    ends = np.cumsum([len(one) for one in episodes])
    kept = np.split(
        np.arange(ends[-1]) // STRETCH % HELD_OUT == HELD_OUT - 1, ends[:-1]
    )
    return [
        rows | unknown
        for rows, unknown in zip(kept, begun(episodes, one_session), strict=True)
    ]


def begun(episodes: Sequence[Episode], one_session: bool = False) -> list[np.ndarray]:
    """Rows that count for nothing, since what came before them is not known; shapes (rows,)."""
    return [
        (np.arange(len(one)) == 0) & (number == 0 or not one_session)
        for number, one in enumerate(episodes)
    ]


def limits_of(problem: Problem) -> tuple[np.ndarray, np.ndarray]:
    """Least and largest coordinates; a start on its limit is within."""
    sides = np.array([one.bounds for one in problem.unknowns]).reshape(-1, 2)
    frame = np.full((len(problem.names) - len(sides), 2), [-np.inf, np.inf])
    low, high = np.concatenate([sides, frame]).T
    return np.minimum(low, -1e-9), np.maximum(high, 1e-9)


def residuals(
    problem: Problem, coordinates: Float[np.ndarray, " coordinates"]
) -> Float[np.ndarray, " seen"]:
    """Differences of states, in parts of what is expected; a large one each where the arm cannot be."""
    return compared(
        problem, coordinates, simulated(problem, coordinates[: len(problem.unknowns)])
    )


def simulated(
    problem: Problem, coordinates: Float[np.ndarray, " unknowns"]
) -> list[States] | None:
    """What the arm at these coordinates does, none where it cannot be or blows up."""
    try:
        arm = arm_at(problem.arm, problem.unknowns, coordinates)
        return replayed(arm, problem.episodes, problem.options.replay)
    except (SimulationError, ValidationError):
        return None


def compared(
    problem: Problem,
    coordinates: Float[np.ndarray, " coordinates"],
    states: list[States] | None,
) -> Float[np.ndarray, " seen"]:
    """The same for states that were worked out before; what arms do does not depend on the frame."""
    seen = np.concatenate(problem.seen)
    if states is None:
        return np.full(np.isfinite(seen).sum(), FAILED)
    apart = np.concatenate([framed(problem, coordinates, one) for one in states]) - seen
    expected = EXPECTED * problem.arm.length
    apart[..., POSITION] /= expected
    apart[..., AXIS] *= per_module(problem.arm, "length").mean() / expected
    return apart[np.isfinite(seen)]


def framed(problem: Problem, coordinates: np.ndarray, states: States) -> States:
    """States as they look in the recording's frame."""
    if not problem.options.frame:
        return states
    moved = FRAME_SPREAD * coordinates[len(problem.unknowns) :]
    turn = Rotation.from_rotvec(moved[:3]).as_matrix()
    shift = moved[3:] * problem.arm.length
    return np.concatenate(
        [states[..., POSITION] @ turn.T + shift, states[..., AXIS] @ turn.T], axis=-1
    )
