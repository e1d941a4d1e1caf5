"""Plausibility of tracked states: reach, fit of neighboring modules, jumps."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from jaxtyping import Float

from s2c2a.arm.tracking import MOUNTING, STRETCH
from s2c2a.lab.tracking.poses import TrackingError
from s2c2a.spaces import AXIS, POSITION

BEND_MARGIN = np.deg2rad(25.0)
"""Bend beyond the limit of a module that shortens its chord [rad]."""
AXIS_MARGIN = np.deg2rad(60.0)
"""Angle between a chord and an axis beyond the bend limit, under a swinging payload
[rad]."""
SPEED = 5.0
"""Largest speed of a module end [m/s]."""
PERSISTENCE = 5
"""Consistent frames after which a module end is accepted at another place."""

_SAMPLES = 50
_NO_LIMIT = -2.0  # below every cosine
_OUT_OF_REACH = "out of reach"
_JUMPED = "jumped"


@dataclass(frozen=True, eq=False)
class CheckedStates:
    """States without the rows that cannot be true.

    Attributes:
        states: end position [m] and end axis, base frame; NaN where a row is missing or
            rejected; shape (modules, 6).
        reasons: why the row of a module is rejected; empty if it is not.
    """

    states: Float[np.ndarray, "modules 6"]
    reasons: tuple[str, ...]


class StateCheck:
    """Rejects tracked states that the arm cannot have.

    Every pair of ends, the base among them, is compared with the curves whose tangent
    turns by no more than the bend limits between them. With the total turn T, the
    chord is at most as long as the modules, and at least as long as that of a planar
    curve that turns by T (Schur's comparison theorem, for T <= pi); its angles to both
    end axes are at most T, and it leads along them as far as a curve that turns back
    at once. Each bound has a margin.

    The base is never rejected: a row that contradicts it is. Of rows whose distance is
    impossible, those with the most contradictions are rejected, both if these are
    equal. An axis that contradicts its chord, such as a flipped one, rejects its row.

    A row that is further from its last place than an end can move is rejected until
    it has stayed near its new place for some frames.
    """

    def __init__(
        self,
        lengths: Float[np.ndarray, " modules"],
        bend_limits: Float[np.ndarray, " modules"],
    ):
        """A check without a history.

        Args:
            lengths: of the modules [m].
            bend_limits: largest bends [rad].

        Raises:
            TrackingError: a length or a limit is missing, or not positive.
        """
        self._lengths = np.array(lengths, dtype=float)
        limits = np.array(bend_limits, dtype=float)
        _check_positive(self._lengths, limits)
        modules = len(self._lengths)
        # a body off the center line turns the chord of a short module more
        tilts = MOUNTING / self._lengths
        self._set_bounds(limits + BEND_MARGIN + tilts, limits + AXIS_MARGIN + tilts)
        # row 0 is the base
        self._positions = np.zeros((modules + 1, 3))
        self._axes = np.zeros((modules + 1, 3))
        self._axes[0, 2] = 1.0
        self.reset()

    def _set_bounds(self, chord_turns: np.ndarray, axis_turns: np.ndarray) -> None:
        """Compute the bounds of pairs (j, k), j < k: distance, cosine, chord along axes.

        Args:
            chord_turns: largest turns of the modules that shorten a chord [rad].
            axis_turns: largest turns between a chord and an axis [rad].
        """
        rows = len(self._lengths) + 1
        self._longest = np.full((rows, rows), np.inf)
        self._shortest = np.zeros((rows, rows))
        self._cosines = np.full((rows, rows), _NO_LIMIT)
        self._least_first = np.full((rows, rows), -np.inf)
        self._least_last = np.full((rows, rows), -np.inf)
        for first, last in combinations(range(rows), 2):
            lengths = self._lengths[first:last]
            chord = _shortest_chord(lengths, chord_turns[first:last])
            self._longest[first, last] = (1 + STRETCH) * lengths.sum() + MOUNTING
            self._shortest[first, last] = (1 - STRETCH) * chord - MOUNTING
            between = axis_turns[first:last]
            turn = between.sum()
            if turn < np.pi:
                self._cosines[first, last] = np.cos(turn)
            least = _least_progress(lengths, between) - MOUNTING
            self._least_first[first, last] = least
            least = _least_progress(lengths[::-1], between[::-1]) - MOUNTING
            self._least_last[first, last] = least

    def reset(self) -> None:
        """Forget all places, as after a restart of the source."""
        modules = len(self._lengths)
        self._places = np.full((modules, 3), np.nan)
        self._times = np.zeros(modules)
        self._candidates = np.full((modules, 3), np.nan)
        self._candidate_times = np.zeros(modules)
        self._counts = np.zeros(modules, dtype=int)

    def __call__(
        self, states: Float[np.ndarray, "modules 6"], time: float
    ) -> CheckedStates:
        """Return the states without the rows that cannot be true.

        Args:
            states: end position [m] and end axis, base frame; NaN where missing.
            time: of the measurement, on any steady clock [s].
        """
        reasons = [""] * len(states)
        self._positions[1:] = states[:, POSITION]
        self._axes[1:] = states[:, AXIS]
        # pairs (j, k) are impossible by their distance, axis j or axis k
        positions = self._positions
        axes = self._axes
        # chords[j, k] leads from end j to end k; comparisons with NaN are false
        chords = positions - positions[:, None]
        distances = np.sqrt(np.einsum("jkx,jkx->jk", chords, chords))
        least = self._cosines * distances
        impossible = distances > self._longest
        impossible |= distances < self._shortest
        along_first = np.einsum("jkx,jx->jk", chords, axes)
        along_last = np.einsum("jkx,kx->jk", chords, axes)
        first = along_first < np.maximum(least, self._least_first)
        last = along_last < np.maximum(least, self._least_last)
        conflicts = impossible, first, last
        if any(one.any() for one in conflicts):
            self._reject_conflicts(*conflicts, reasons)
        self._reject_jumps(reasons, time)
        checked = states.copy()
        if any(reasons):
            checked[[bool(reason) for reason in reasons]] = np.nan
        return CheckedStates(checked, tuple(reasons))

    def _reject_conflicts(
        self,
        impossible: np.ndarray,
        first: np.ndarray,
        last: np.ndarray,
        reasons: list[str],
    ) -> None:
        """Write the reasons of rows that contradict the base or each other."""
        conflicts = (impossible, first, last)
        together = impossible | first | last
        together |= together.T
        unfit = np.flatnonzero(together[0])
        self._reject(unfit, [0] * len(unfit), conflicts, reasons)
        while any(one.any() for one in conflicts):
            votes = impossible.sum(axis=0) + impossible.sum(axis=1)
            # one of two ends is misplaced; but an axis is wrong by itself
            votes += 2 * (first.sum(axis=1) + last.sum(axis=0))
            worst = np.flatnonzero(votes == votes.max())
            others = [int(np.flatnonzero(together[row])[0]) for row in worst]
            self._reject(worst, others, conflicts, reasons)

    def _reject(
        self,
        rows: np.ndarray,
        others: Sequence[int],
        conflicts: Sequence[np.ndarray],
        reasons: list[str],
    ) -> None:
        """Write the reasons of rows, and remove their conflicts."""
        for row, other in zip(rows.tolist(), others, strict=True):
            place = f"module {other}" if other else "the base"
            reasons[row - 1] = f"does not fit {place}"
            distance = float(np.linalg.norm(self._positions[row]))
            if distance > self._longest[0, row]:
                reasons[row - 1] = _OUT_OF_REACH
        for one in conflicts:
            one[rows] = False
            one[:, rows] = False

    def _reject_jumps(self, reasons: list[str], time: float) -> None:
        """Write the reasons of rows that have moved too far, and note the others."""
        positions = self._positions[1:]
        moved = positions - self._places
        steps = np.sqrt(np.einsum("mx,mx->m", moved, moved))
        allowed = SPEED * np.maximum(time - self._times, 0) + MOUNTING
        # a module without a place has NaN, and does not jump
        jumped = steps > allowed
        for module in np.flatnonzero(jumped).tolist():
            if not reasons[module] and not self._has_settled(module, time):
                reasons[module] = _JUMPED
        # a sum is NaN if a number is
        sound = np.isfinite(positions.sum(axis=1))
        if any(reasons):
            sound &= [not reason for reason in reasons]
        self._places[sound] = positions[sound]
        self._times[sound] = time
        self._counts[sound] = 0

    def _has_settled(self, module: int, time: float) -> bool:
        """Count the consistent frames of a row at another place."""
        position = self._positions[module + 1]
        step = float(np.linalg.norm(position - self._candidates[module]))
        elapsed = max(time - self._candidate_times[module], 0)
        is_near = step <= SPEED * elapsed + MOUNTING
        self._counts[module] = self._counts[module] + 1 if is_near else 1
        self._candidates[module] = position
        self._candidate_times[module] = time
        return bool(self._counts[module] >= PERSISTENCE)


def _shortest_chord(lengths: np.ndarray, turns: np.ndarray) -> float:
    """Return the chord of planar arcs that all turn the same way [m]."""
    if turns.sum() > np.pi:
        return 0.0
    starts = np.cumsum(turns) - turns
    middles = starts + turns / 2
    chords = lengths * np.sinc(turns / 2 / np.pi)
    along = chords @ np.cos(middles)
    return float(np.hypot(along, chords @ np.sin(middles)))


def _least_progress(lengths: np.ndarray, turns: np.ndarray) -> float:
    """Return how far a curve goes along its first tangent at least [m].

    It does so if it turns by as much as it can, until it goes back.
    """
    angles = np.concatenate([[0.0], np.cumsum(turns)])
    shares = np.linspace(0.0, 1.0, _SAMPLES)
    tangents = angles[:-1, None] + turns[:, None] * shares
    return float(lengths @ np.cos(np.minimum(tangents, np.pi)).mean(axis=1))


def _check_positive(lengths: np.ndarray, limits: np.ndarray) -> None:
    if not (lengths.ndim == 1 and len(lengths) and (lengths > 0).all()):
        raise TrackingError(
            f"lengths are {lengths.tolist()}; give a positive one of every module [m]"
        )
    if limits.shape != lengths.shape or not (limits > 0).all():
        raise TrackingError(
            f"bend limits are {limits.tolist()}; give a positive one of every module "
            f"[rad], {len(lengths)} in all"
        )
