"""Stated values hold, and the summary names those that the log contradicts."""

from dataclasses import replace

import numpy as np
import pytest
from cable_parameters import straight_arm, wiring_of

from s2c2a.logs import LogMap
from s2c2a.logs.arm_file import _length_origin
from s2c2a.logs.cable_model import states_in_log
from s2c2a.logs.model_fit import Observations, fit_parameters, predict_states
from s2c2a.logs.stated_values import describe_contradictions

from marks import slow_after

TRUE = straight_arm([0.1, 0.2], base=np.array([0.1, 0.2, 0.3]))
WIRING = wiring_of(2)
STD = {"gains": 0.1, "offsets": 0.1, "gravity": 1e-6, "stiffness": 2.0, "angles": 2.0}


@pytest.fixture(scope="module")
def log() -> Observations:
    """Both ends of an arm of two modules, without noise."""
    columns = np.random.default_rng(0).uniform(-0.7, 0.7, (60, 6))
    _, states = predict_states(TRUE, WIRING, columns, False)
    states = np.asarray(states_in_log(TRUE, states, np.eye(3)))
    return Observations(columns, states, np.eye(3), False, STD, 0.3)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "wrong", "deviation", "text"),
    slow_after(
        1,
        [
            ("base", np.array([0.1, 0.2, 0.32]), 0.002, "a smaller z of frame.base"),
            ("base", np.array([0.08, 0.2, 0.3]), 0.002, "a larger x of frame.base"),
            ("lengths", np.log([0.12, 0.2]), 0.002, "a smaller number 0 of arm.length"),
            ("total", np.log(0.36), 0.002, "a smaller arm.length"),
            ("tilt", np.array([0.0, -0.1]), 0.02, "frame.along turned towards x"),
        ],
    ),
)
def test_a_wrong_statement_holds_in_repeated_fits_and_is_named(
    log, name, wrong, deviation, text
):
    stated = replace(log, bounds={name: (wrong, deviation)})
    fit = fit_parameters(stated, TRUE, WIRING)
    for _ in range(2):
        fit = fit_parameters(stated, fit.parameters, WIRING, with_std=True)
    if name == "total":
        value = np.log(np.exp(fit.parameters.lengths).sum())
    else:
        value = getattr(fit.parameters, name)
    assert np.abs(value - wrong).max() <= deviation + 1e-9
    assert text in describe_contradictions(fit, stated)


@pytest.mark.parametrize("name", slow_after(1, ["base", "lengths", "total", "tilt"]))
def test_true_statements_are_not_contradicted(log, name):
    value = np.log(0.3) if name == "total" else getattr(TRUE, name)
    stated = replace(log, bounds={name: (value, 0.002)})
    start = TRUE._replace(gain=np.array(0.2), lengths=np.log([0.15, 0.15]))
    fit = fit_parameters(stated, start, WIRING)
    assert describe_contradictions(fit, stated) == ""
    np.testing.assert_allclose(np.exp(fit.parameters.lengths), [0.1, 0.2], atol=1e-3)


def test_a_bound_that_an_error_of_the_model_reaches_is_no_contradiction(log):
    """Without the bound, errors of 3 cm are about as large."""
    noise = np.random.default_rng(1).normal(0, 0.03, log.states.shape)
    noisy = replace(log, states=log.states + noise)
    tilt = np.array([0.0, -0.03])
    stated = replace(noisy, bounds={"tilt": (tilt, 0.01)})
    fit = fit_parameters(stated, TRUE, WIRING)
    assert np.abs(fit.parameters.tilt - tilt).max() >= 0.0095
    assert describe_contradictions(fit, stated) == ""


@pytest.mark.slow
def test_deviations_of_lengths_are_the_same_with_a_stated_sum(log):
    """A bound that is not reached changes variables, not deviations."""
    noise = np.random.default_rng(1).normal(0, 1e-3, log.states.shape)
    noisy = replace(log, states=log.states + noise)
    wide = replace(noisy, bounds={"total": (np.log(0.3), 1.0)})
    free = fit_parameters(noisy, TRUE, WIRING, with_std=True).std
    stated = fit_parameters(wide, TRUE, WIRING, with_std=True).std
    assert free is not None
    assert stated is not None
    np.testing.assert_allclose(free.lengths, stated.lengths, rtol=0.02)


@pytest.mark.parametrize(
    ("ends", "lengths", "expected"),
    [
        ([1], None, ["not determined by the measured ends; state it"] * 2),
        ([0, 1], None, ["+- 0.00200", "+- 0.00200"]),
        ([1], [0.1, 0.2], ["stated", "stated"]),
    ],
)
def test_a_length_has_a_deviation_only_between_measured_ends(ends, lengths, expected):
    log_map = LogMap.model_validate(
        {
            "rows": {"kind": "timed", "rate": 10},
            "arm": {
                "name": "two",
                "modules": 2,
                "control_rate": 10,
                "lengths": lengths,
            },
            "drives": [{"commanded": f"c{each}", "unit": "mm"} for each in range(6)],
            "ends": [
                {"module": end, "position": [f"x{end}", f"y{end}", f"z{end}"]}
                | {"unit": "m"}
                for end in ends
            ],
        }
    )
    assert [_length_origin(module, 0.02, 0.1, log_map) for module in (0, 1)] == expected
