"""Descriptions of state estimates, for a step and for a run."""

import numpy as np
import pytest

from made_up import made_up
from s2c2a.evaluation import describe_estimates, describe_step_estimates


def make_episode(**columns):
    bend_biases = np.zeros((4, 3, 2))
    bend_biases[2, 1, 0] = np.deg2rad(1.5)
    estimates = {
        "payload": np.full(4, 0.052),
        "bend_biases": bend_biases,
        "external_force": np.array([0.0, 0.1, 0.3, 0.2]),
    }
    return made_up(4, **(estimates | columns))


@pytest.mark.parametrize(
    ("imu", "ending"),
    [([0, 1, 1, 0], "; rejected: imu 50 % of the steps"), ([0, 0, 0, 0], "")],
)
def test_a_run_is_described_by_payload_largest_bend_bias_force_and_rejected_sensors(
    imu, ending
):
    rejected = {"rejected.imu": np.array(imu, float), "rejected.flex": np.zeros(4)}
    text = "payload 52 g, largest bend bias 1.5 deg (external force 0.3 N)"
    assert describe_estimates(make_episode(**rejected)) == text + ending


def test_a_payload_at_the_bound_of_the_filter_is_no_measurement():
    bound = np.full(4, np.float32(3.0 * make_episode().arm.mass))
    episode = make_episode(**{"rejected.imu": np.zeros(4), "payload": bound})
    assert describe_estimates(episode).startswith("payload at least ")


def test_a_run_without_an_estimator_has_no_description():
    assert describe_estimates(make_episode()) == ""


@pytest.mark.parametrize(
    ("is_rejected", "ending"), [(0.0, ""), (1.0, "; **rejected: imu**")]
)
def test_a_step_is_described_likewise(is_rejected, ending):
    diagnostics = {
        "payload": np.array(0.048),
        "bend_biases": np.deg2rad([[0.3, 0.4], [1.2, 0.0]]),
        "external_force": np.array(0.31),
        "rejected.imu": np.array(is_rejected),
    }
    text = "payload 48 g, largest bend bias 1.2 deg (external force 0.3 N)"
    assert describe_step_estimates(diagnostics) == text + ending


def test_a_filter_that_estimates_nothing_says_so():
    rejected = {"rejected.imu": np.zeros(4)}
    nothing = {"payload": np.zeros(4), "bend_biases": np.zeros((4, 3, 2))}
    episode = made_up(4, external_force=np.zeros(4), **nothing, **rejected)
    assert describe_estimates(episode) == "no payload or bend bias is estimated"


def test_a_step_without_an_estimator_has_no_description():
    assert describe_step_estimates({"payload": np.array(0.0)}) == ""
