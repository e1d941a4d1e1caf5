"""Least squares for the model of cables: residuals in parts of the arm's length, beside what was known before."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from s2c2a.logs.tendons import Guess, Wiring, model_states, seen_states, settled_bends

ROUNDS = 40
BLOCKS = 20
OUTLYING = 0.05  # of the length: residuals beyond weigh less than their square
WIDE = 1e3
WAYS = 36.0  # in which what a model leaves may repeat itself


@dataclass(frozen=True)
class Seen:
    """What the model shall explain.

    Attributes:
        columns: what the drives did, shape (rows, drives).
        states: ends in the frame of the file [m, 1], shape (rows, modules, 6); NaN
            where nothing was seen.
        frame: columns are the axes of the untilted base frame.
        tension: whether drives say tensions.
        spread: of each number, and of the sum of all lengths (`total`), how far it may
            be from its first guess, as a standard deviation.
        scale: length of the arm [m].
    """

    columns: Float[np.ndarray, "rows drives"]
    states: Float[np.ndarray, "rows modules 6"]
    frame: Float[np.ndarray, "3 3"]
    tension: bool
    spread: Mapping[str, float]
    scale: float


@dataclass(frozen=True)
class Fit:
    """What was found.

    Attributes:
        guess: the numbers.
        wiring: that they belong to.
        cost: half the sum of squares that was left.
        errors: standard deviations of the numbers.
    """

    guess: Guess
    wiring: Wiring
    cost: float
    errors: Guess | None = None


def fitted(
    seen: Seen, first: Guess, wiring: Wiring, rounds: int = ROUNDS, errors: bool = False
) -> Fit:
    """The numbers that explain best what was seen, from a first guess.

    Args:
        seen: what was seen.
        first: where to begin, and what stays likely.
        wiring: which motor pulls what.
        rounds: of the search.
        errors: whether standard deviations are desired.
    """
    from scipy.optimize import least_squares

    with jax.enable_x64(True):
        start, back = flat(first)
        known = np.isfinite(seen.states)
        arrays = (
            start,
            *_weights(seen, known),
            seen.columns,
            np.nan_to_num(seen.states),
            seen.frame,
            wiring,
            first,
        )
        spread = flat(
            Guess(
                *(
                    np.full(np.shape(part), seen.spread.get(name, WIDE))
                    for name, part in first._asdict().items()
                )
            )
        )[0]
        likely = spread, seen.spread.get("total", WIDE)

        def residuals(numbers):
            return np.asarray(_residuals(numbers, *arrays, *likely, seen.tension))

        def slopes(numbers):
            return np.asarray(_slopes(numbers, *arrays, *likely, seen.tension))

        found = least_squares(
            residuals,
            start,
            slopes,
            loss="soft_l1",
            f_scale=1.0,
            max_nfev=rounds,
            x_scale=np.minimum(spread, 1.0),
        )
        deviations = (
            back(
                _deviations(
                    residuals(found.x), slopes(found.x), len(start), len(seen.columns)
                )
            )
            if errors
            else None
        )
    return Fit(back(found.x), wiring, float(found.cost), deviations)


def flat(guess: Guess):
    """The numbers as one vector, and the way back."""
    shapes = [np.shape(part) for part in guess]
    edges = np.cumsum([int(np.prod(shape)) for shape in shapes])[:-1]

    def back(vector: np.ndarray) -> Guess:
        return Guess(
            *(
                part.reshape(shape)
                for part, shape in zip(
                    np.split(np.asarray(vector), edges), shapes, strict=True
                )
            )
        )

    return np.concatenate([np.ravel(part) for part in guess]).astype(float), back


def _unflat(vector, like: Guess) -> Guess:
    shapes = [np.shape(part) for part in like]
    edges = np.cumsum([int(np.prod(shape)) for shape in shapes])[:-1]
    return Guess(
        *(
            part.reshape(shape)
            for part, shape in zip(jnp.split(vector, edges), shapes, strict=True)
        )
    )


def _weights(seen: Seen, known: np.ndarray) -> tuple[np.ndarray]:
    """One over the size of a residual that is nothing special; axes count as a module's length away."""
    size = OUTLYING * np.concatenate(
        [np.full(3, seen.scale), np.full(3, seen.states.shape[1])]
    )
    return (known / size,)


def _rows(
    vector, start, weights, columns, states, frame, wiring, like, spread, total, tension
):
    guess = _unflat(vector, like)
    predicted = seen_states(
        guess,
        model_states(guess, settled_bends(guess, wiring, columns, tension)),
        frame,
    )
    apart = (weights * (predicted - states)).reshape(len(columns), -1)
    longer = jnp.log(
        jnp.sum(jnp.exp(guess.lengths)) / jnp.sum(jnp.exp(_unflat(start, like).lengths))
    )
    return jnp.concatenate(
        [apart.reshape(-1), (vector - start) / spread, longer[None] / total]
    )


_residuals = partial(jax.jit, static_argnames="tension")(_rows)
_slopes = partial(jax.jit, static_argnames="tension")(jax.jacfwd(_rows))


def predicted_states(
    guess: Guess, wiring: Wiring, columns: np.ndarray, tension: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Bends [rad] and states [m, 1] in the base frame, in rows."""
    with jax.enable_x64(True):
        bends = settled_bends(guess, wiring, columns, tension)
        return np.asarray(bends), np.asarray(model_states(guess, bends))


def _deviations(
    residuals: np.ndarray, slopes: np.ndarray, numbers: int, rows: int
) -> np.ndarray:
    """Standard deviations.

    Rows near each other err together, so blocks of them are what varies. And what the
    model leaves is no noise: it comes again in every block, and one of the ways in
    which it does may look like a change of a number.
    """
    inverse = np.linalg.pinv(slopes.T @ slopes, hermitian=True)
    count = len(residuals) - numbers - 1  # beside what was known before
    data = slice(0, count)
    each = count // rows
    blocks = np.arange(rows).repeat(each) * BLOCKS // rows
    pushes = np.zeros((BLOCKS, numbers))
    np.add.at(pushes, blocks, slopes[data] * residuals[data, None])
    spread = inverse @ (pushes.T @ pushes) @ inverse * BLOCKS / (BLOCKS - 1)
    felt = np.diag(inverse @ slopes[data].T @ slopes[data] @ inverse)
    return np.sqrt(np.diag(spread) + residuals[data] @ residuals[data] * felt / WAYS)
