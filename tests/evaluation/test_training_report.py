"""What a training says of motion that it has not seen, and of the vibration."""

from dataclasses import replace

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.estimation import MODAL_MODEL
from s2c2a.evaluation import describe_modal_model, describe_unseen_errors
from s2c2a.strategies import TrainedNetworks, recipe_named

ERRORS = {
    "validation samples": 0.0031,
    "slower motion": 0.0034,
    "faster motion": 0.0052,
    "larger bends": 0.006,
    "unseen region": 0.0048,
}


@pytest.fixture
def networks() -> TrainedNetworks:
    """No networks, of the twin."""
    return TrainedNetworks(load_arm("twin_arm"), recipe_named("best"), 0, {}, {}, {})


def test_errors_on_unseen_motion_are_listed_in_millimeters(networks):
    trained = replace(networks, errors={"C2S": ERRORS})
    assert describe_unseen_errors(trained) == [
        "C2S on motion that a second training has not seen: validation samples 3.1 mm, "
        "slower motion 3.4, faster motion 5.2, larger bends 6.0, unseen region 4.8"
    ]
    assert describe_unseen_errors(networks) == []


def test_errors_far_above_the_usual_one_name_the_data_to_record(networks):
    errors = ERRORS | {"faster motion": 0.007, "unseen region": 0.02}
    lines = describe_unseen_errors(replace(networks, errors={"C2S": errors}))
    assert lines[1] == (
        "errors on faster motion and unseen region are more than twice those on "
        "validation samples: record more data with fast motion; more combinations of "
        "bends, opposed ones too"
    )


def test_without_an_error_on_validation_samples_there_is_no_advice(networks):
    errors = {"faster motion": 0.007}
    assert len(describe_unseen_errors(replace(networks, errors={"C2S": errors}))) == 1


@pytest.mark.parametrize(
    ("percent", "without", "text"),
    [
        (40.0, 0.5, "it reduces the fast part of the C2S error by 60 %"),
        (99.7, 0.5, "it reduces the fast part of the C2S error by 0.3 %"),
        (99.999979, 0.5, "the recording does not show the vibration; frequency"),
        (100.0, 0.5, "the recording does not show the vibration; frequency"),
        (100.0, 0.0, "the recording has no complete episode that is long enough"),
    ],
)
def test_the_modal_model_is_described_also_where_the_response_is_unknown(
    networks, percent, without, text
):
    curve = np.array([[0.0, without, without], [1.0, without, without]])
    trained = replace(
        networks,
        percent={MODAL_MODEL: (percent, 0.0)},
        curves={MODAL_MODEL: curve},
    )
    assert describe_modal_model(trained).startswith(f"modal model: {text}")
    assert describe_modal_model(networks) == ""
