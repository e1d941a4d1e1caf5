"""What a training says of samples that it has not seen, and of the vibration."""

from dataclasses import replace

import numpy as np
import pytest

import s2c2a
from s2c2a.arm import load_arm
from s2c2a.cli.run import _given_networks
from s2c2a.estimation import MODAL_MODEL
from s2c2a.evaluation import describe_held_out_errors, describe_modal_model
from s2c2a.live.cli.driven_arm import print_remarks
from s2c2a.strategies import TrainedNetworks, recipe_named, save_networks
from s2c2a.strategies.checkpoint import SHIPPED
from s2c2a.training import Trained


@pytest.fixture
def networks() -> TrainedNetworks:
    """No networks, of the twin."""
    return TrainedNetworks(load_arm("twin_arm"), recipe_named("best"), 0, {})


def test_errors_on_held_out_samples_are_listed_in_millimeters(networks):
    trained = replace(
        networks,
        trained={"C2S": Trained(None, errors={"held-out samples": 0.0031})},
    )
    assert describe_held_out_errors(trained) == [
        "C2S at the tip: 3.1 mm (mean) on held-out samples, which have gaps of time to "
        "those of the training"
    ]
    assert describe_held_out_errors(networks) == []


@pytest.mark.parametrize(("percent", "warnings"), [(4.2, 0), (4.3, 1)])
def test_a_controller_that_errs_by_more_than_a_control_step_is_warned_of(
    networks, percent, warnings
):
    # a step of the twin is 4 deg of bends of 47 deg to both sides: 4.26 %
    trained = {"C2S": Trained(None), "C2A": Trained(None, percent=(percent, 1.0))}
    lines = describe_held_out_errors(replace(networks, trained=trained))
    assert len(lines) == warnings
    assert all("C2A errs by more than a control step (4.3 %)" in line for line in lines)


def test_a_controller_that_errs_is_warned_of_before_it_drives(
    tmp_path, tiny_networks, capsys
):
    weights = tmp_path / "mine.safetensors"
    erring = replace(tiny_networks.trained["C2A"], percent=(9.0, 1.0))
    trained = {**tiny_networks.trained, "C2A": erring}
    save_networks(replace(tiny_networks, trained=trained), weights)
    _given_networks(weights, tiny_networks.arm, None, "")
    assert capsys.readouterr().out.startswith("warning: C2A errs by more than")
    with pytest.warns(UserWarning, match=r"^C2A errs by more than"):
        s2c2a.load_strategy(weights)
    print_remarks([SHIPPED, str(weights)])
    assert capsys.readouterr().out.startswith(f"{weights}: warning: C2A errs")


@pytest.mark.parametrize(
    ("percent", "without", "text"),
    [
        (40.0, 0.5, "it reduces the fast part of the C2S error by 60 %"),
        (99.7, 0.5, "it reduces the fast part of the C2S error by 0.3 %"),
        (99.999979, 0.5, "frequency and damping fit the recording, but do not reduce"),
        (100.0, 0.5, "frequency and damping fit the recording, but do not reduce"),
        (100.0, 0.0, "the recording has no complete episode that is long enough"),
    ],
)
def test_the_modal_model_is_described_also_where_the_response_is_unknown(
    networks, percent, without, text
):
    curve = np.array([[0.0, without, without], [1.0, without, without]])
    trained = replace(
        networks,
        trained={MODAL_MODEL: Trained(None, curve, (percent, 0.0))},
    )
    assert describe_modal_model(trained).startswith(f"modal model: {text}")
    assert describe_modal_model(networks) == ""
