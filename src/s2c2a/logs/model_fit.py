"""Least-squares fit of the cable model, with a prior on each parameter.

Residuals are relative to the length of the arm. Stated values stay within bounds, since
errors of the model repeat in every row and would outvote any prior.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from scipy.optimize import least_squares

from s2c2a.logs.cable_model import (
    CableParameters,
    Numbers,
    Wiring,
    equilibrium_bends,
    states_in_base,
    states_in_log,
)
from s2c2a.logs.interpolation import evenly_spread

PART = 10_000  # rows that are predicted at once; four times as many take 0.14 s
MAX_ITERATIONS = 40
MAX_FITTED = 200  # rows of a fit
BLOCKS = 20
OUTLIER = 0.05  # relative residual from which the robust loss grows linearly
WIDE = 1e3  # prior standard deviation of a free parameter
# number of independent patterns in which the model error may repeat itself
ERROR_PATTERNS = 36.0


@dataclass(frozen=True)
class Observations:
    """Data that the model has to explain.

    Attributes:
        columns: values of the drives, shape (rows, drives).
        states: ends in the frame of the log [m, 1], shape (rows, modules, 6); NaN: not
            measured.
        axes: axes of the untilted base frame as columns, frame of the log.
        tension: whether the drives are in units of tension.
        prior_std: standard deviation of each parameter about its first guess, and of
            the logarithm of the total length (`total`).
        scale: length of the arm [m].
        bounds: stated value of parameters, or of `total`, and the largest deviation.
    """

    columns: Float[np.ndarray, "rows drives"]
    states: Float[np.ndarray, "rows modules 6"]
    axes: Float[np.ndarray, "3 3"]
    tension: bool
    prior_std: Mapping[str, float]
    scale: float
    bounds: Mapping[str, tuple[np.ndarray, float]] = field(default_factory=dict)

    def thinned(self) -> "Observations":
        """Evenly spread rows, as many in every fit, so that all are compiled once."""
        rows = evenly_spread(len(self.columns), MAX_FITTED)
        return replace(self, columns=self.columns[rows], states=self.states[rows])


@dataclass(frozen=True)
class CableFit:
    """Fitted cable model.

    Attributes:
        parameters: the fitted parameters.
        wiring: motors and routes of the cables.
        cost: half the robust sum of squared residuals.
        std: standard deviations of the parameters.
    """

    parameters: CableParameters
    wiring: Wiring
    cost: float
    std: CableParameters | None = None


def fit_parameters(
    observations: Observations,
    start: CableParameters,
    wiring: Wiring,
    iterations: int = MAX_ITERATIONS,
    with_std: bool = False,
) -> CableFit:
    """Fit the parameters to observations.

    Args:
        observations: the data.
        start: first guess, and the mean of the prior.
        wiring: motors and routes of the cables.
        iterations: largest number of function evaluations.
        with_std: whether to compute standard deviations.
    """
    std = None
    by_total = "total" in observations.bounds
    with jax.enable_x64(True):
        first = flatten(start)
        prior_std = _prior_std(observations, start)
        arguments = (
            first,
            _weights(observations),
            observations.columns,
            np.nan_to_num(observations.states),
            observations.axes,
            wiring,
            start,
            prior_std,
            observations.prior_std.get("total", WIDE),
            observations.tension,
            by_total,
        )

        def residuals(vector):
            return np.asarray(_compiled_residuals(vector, *arguments))

        def jacobian(vector):
            return np.asarray(_compiled_jacobian(vector, *arguments))

        low, high = _bounds(observations, start)
        variables = _to_variables(start, by_total)
        result = least_squares(
            residuals,
            np.clip(variables, low, high),
            jacobian,
            bounds=(low, high),
            loss="soft_l1",
            f_scale=1.0,
            max_nfev=iterations,
            x_scale=np.minimum(prior_std, 1.0),
        )
        parameters = _from_variables(result.x, start, by_total)
        if with_std:
            vector = _standard_deviations(
                residuals(result.x),
                jacobian(result.x) @ _variables_jacobian(parameters, by_total),
                *observations.columns.shape,
            )
            std = unflatten(vector, start)
    return CableFit(parameters, wiring, float(result.cost), std)


def flatten(parameters: CableParameters) -> np.ndarray:
    """All parameters as one vector."""
    return np.concatenate([np.ravel(value) for value in parameters]).astype(float)


def unflatten(vector, like: CableParameters) -> CableParameters:
    """Parameters from one vector, with the shapes of others."""
    values = []
    begin = 0
    for value in like:
        end = begin + np.size(value)
        values.append(vector[begin:end].reshape(np.shape(value)))
        begin = end
    return CableParameters(*values)


def _to_variables(parameters: CableParameters, by_total: bool) -> np.ndarray:
    """Vector of which bounds are intervals.

    Where the length of the arm is stated, lengths are the logarithm of their sum, and
    of their ratios to the last one.
    """
    if not by_total:
        return flatten(parameters)
    lengths = parameters.lengths
    total = np.log(np.sum(np.exp(lengths)))
    return flatten(
        parameters._replace(lengths=np.append(total, lengths[:-1] - lengths[-1]))
    )


def _from_variables(vector, like: CableParameters, by_total: bool) -> CableParameters:
    parameters = unflatten(vector, like)
    if not by_total:
        return parameters
    total = parameters.lengths[0]
    ratios = parameters.lengths[1:]
    shares: Numbers = jax.nn.log_softmax(jnp.append(ratios, 0.0))
    if isinstance(vector, np.ndarray):
        shares = np.asarray(shares)
    return parameters._replace(lengths=total + shares)


def _variables_jacobian(parameters: CableParameters, by_total: bool) -> np.ndarray:
    """Derivative of the variables by the parameters."""
    matrix = np.eye(len(flatten(parameters)))
    if not by_total:
        return matrix
    lengths = np.exp(parameters.lengths)
    block = np.eye(len(lengths), k=-1)
    block[1:, -1] -= 1.0
    block[0] = lengths / lengths.sum()
    before = parameters[: CableParameters._fields.index("lengths")]
    begin = sum(np.size(value) for value in before)
    own = slice(begin, begin + len(lengths))
    matrix[own, own] = block
    return matrix


def _bounds(
    observations: Observations, start: CableParameters
) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest variables; infinite where nothing is stated."""
    ends = []
    for sign in (-1.0, 1.0):
        free = [np.full(np.shape(value), sign * np.inf) for value in start]
        values = CableParameters(*free)
        for name, (stated, deviation) in observations.bounds.items():
            if name == "total":
                values.lengths[0] = stated + sign * deviation
            else:
                values = values._replace(**{name: stated + sign * deviation})
        ends.append(flatten(values))
    return ends[0], ends[1]


def _prior_std(observations: Observations, start: CableParameters) -> np.ndarray:
    values = start._asdict()
    std = observations.prior_std
    return flatten(
        CableParameters(
            *(np.full(np.shape(values[name]), std.get(name, WIDE)) for name in values)
        )
    )


def _weights(observations: Observations) -> np.ndarray:
    """Inverse scale of each residual; zero where nothing is measured.

    An error of an axis counts like that of a point a module's length away.
    """
    modules = observations.states.shape[1]
    size = np.repeat([observations.scale, modules], 3)
    return np.isfinite(observations.states) / (OUTLIER * size)


def _residuals(
    variables,
    start,
    weights,
    columns,
    states,
    axes,
    wiring,
    like,
    std,
    total_std,
    tension,
    by_total,
):
    parameters = _from_variables(variables, like, by_total)
    vector = jnp.concatenate([jnp.ravel(value) for value in parameters])
    bends = equilibrium_bends(parameters, wiring, columns, tension)
    predicted = states_in_log(parameters, states_in_base(parameters, bends), axes)
    errors = weights * (predicted - states)
    length = jnp.sum(jnp.exp(parameters.lengths))
    start_length = jnp.sum(jnp.exp(unflatten(start, like).lengths))
    stretch = jnp.log(length / start_length)[None]
    return jnp.concatenate(
        [errors.reshape(-1), (vector - start) / std, stretch / total_std]
    )


_compile = partial(jax.jit, static_argnames=("tension", "by_total"))
_compiled_residuals = _compile(_residuals)
_compiled_jacobian = _compile(jax.jacfwd(_residuals))


def predict_states(
    parameters: CableParameters, wiring: Wiring, columns: np.ndarray, tension: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Bends [rad] and states [m, 1] of each row, base frame.

    In parts: of 300,000 systems at once, XLA's solver does not return on two cores; and
    Ctrl-C works between them.
    """
    parts = np.split(columns, range(PART, len(columns), PART))
    with jax.enable_x64(True):
        found = [
            jax.device_get(_compiled_states(parameters, wiring, part, tension))
            for part in parts
        ]
    bends, states = zip(*found, strict=True)
    return np.concatenate(bends), np.concatenate(states)


def _states(parameters, wiring, columns, tension):
    bends = equilibrium_bends(parameters, wiring, columns, tension)
    return bends, states_in_base(parameters, bends)


_compiled_states = partial(jax.jit, static_argnames="tension")(_states)


def _standard_deviations(
    residuals: np.ndarray, jacobian: np.ndarray, rows: int, drives: int
) -> np.ndarray:
    """Standard deviations of the parameters, of gains from their mean.

    Residuals of nearby rows are correlated, so the scatter is that of blocks of rows.
    The model error is not noise: it repeats in every block, and one of its patterns may
    look like a change of a parameter. What the log does not excite keeps the deviation
    of the prior.
    """
    numbers = jacobian.shape[1]
    inverse = np.linalg.pinv(jacobian.T @ jacobian, hermitian=True)
    count = len(residuals) - numbers - 1  # without the prior
    prior = jacobian[count:]
    residuals = residuals[:count]
    jacobian = jacobian[:count]
    blocks = np.arange(rows).repeat(count // rows) * BLOCKS // rows
    gradients = np.zeros((BLOCKS, numbers))
    np.add.at(gradients, blocks, jacobian * residuals[:, None])
    scatter = gradients.T @ gradients * BLOCKS / (BLOCKS - 1)
    model_error = residuals @ residuals / ERROR_PATTERNS * jacobian.T @ jacobian
    covariance = inverse @ (scatter + model_error + prior.T @ prior) @ inverse
    # a common factor of the gains counts as part of `gain`, as in arm files
    centered = np.eye(numbers)
    gains = slice(drives + 1, 2 * drives + 1)
    centered[drives, gains] = 1 / drives
    centered[gains, gains] -= 1 / drives
    return np.sqrt(np.diag(centered @ covariance @ centered.T))
