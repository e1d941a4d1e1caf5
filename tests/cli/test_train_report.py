"""What `train` prints."""

from dataclasses import replace

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.cli.train import report
from s2c2a.estimation import MODAL_MODEL
from s2c2a.estimation.modal_model import ModalFactors
from s2c2a.strategies import TrainedNetworks, recipe_named
from s2c2a.strategies.pcc import GAINS, FittedGains
from s2c2a.training import Trained


@pytest.fixture
def networks() -> TrainedNetworks:
    """Errors of a training, without the networks."""
    errors = {"held-out samples": 0.003}
    curve = np.array([[0.0, 0.5, 0.5], [1.0, 0.3, 0.3]])
    return TrainedNetworks(
        load_arm("twin_arm"),
        recipe_named("best"),
        0,
        {
            "C2S": Trained(None, percent=(1.5, 2.0), errors=errors),
            MODAL_MODEL: Trained(ModalFactors.nominal(), curve, (60.0, 0.0)),
        },
    )


def test_errors_are_in_percent_and_in_millimeters_on_held_out_samples(networks, capsys):
    report(networks, None)
    output = capsys.readouterr().out
    table, lines = output.split("modal model: ")
    assert "1.50 ± 2.00 %" in table
    assert MODAL_MODEL not in table
    assert lines == (
        "it reduces the fast part of the C2S error by 40 %\n"
        "C2S at the tip: 3.0 mm (mean) on held-out samples, which have gaps of time to "
        "those of the training\n"
    )


def test_a_warning_is_the_last_line(networks, capsys):
    trained = {**networks.trained, "C2A": Trained(None, percent=(40.0, 1.0))}
    report(replace(networks, trained=trained), None)
    *_, last = capsys.readouterr().out.splitlines()
    assert last.startswith("warning: C2A errs")


def test_what_is_fitted_without_held_out_data_has_no_error(networks, capsys):
    gains = Trained(FittedGains(np.ones(3)))
    report(replace(networks, trained={GAINS: gains}), None)
    assert capsys.readouterr().out == ""


def test_the_modal_model_of_a_prior_is_not_reported(networks, capsys):
    report(networks, networks)
    output = capsys.readouterr().out
    assert "those of the prior" in " ".join(output.split())
    assert "modal model" not in output
