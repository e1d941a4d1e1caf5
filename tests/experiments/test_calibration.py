"""Calibration of the twin arms against the printed numbers."""

from functools import partial

import pytest

from s2c2a.arm import load_arm
from s2c2a.data import CollectOptions
from s2c2a_experiments import calibration
from s2c2a_experiments.calibration import ESTIMATION, PCC_CIRCLE, WORKSPACE, measure

SIBLINGS = ["twin_capstan", "twin_creep", "twin_both"]


@pytest.fixture
def record(monkeypatch):
    """Set the size of the recordings that are measured."""

    def set_size(**size):
        smaller = partial(CollectOptions, **size)
        monkeypatch.setattr(calibration, "CollectOptions", smaller)

    return set_size


@pytest.mark.slow
def test_estimation_errors_workspace_and_pcc_error_of_the_twin_match_the_paper(record):
    record(episodes=6)
    values = measure(load_arm("twin_arm"), seed=0, with_pcc=True, with_network=False)
    claims = (*ESTIMATION, *WORKSPACE, PCC_CIRCLE)
    assert [
        claim.quantity for claim in claims if not claim.holds(values[claim.quantity])
    ] == []


@pytest.mark.parametrize(
    ("name", "kinds"),
    [
        ("twin_arm", {"backlash"}),
        ("twin_capstan", {"friction"}),
        ("twin_creep", {"creep"}),
        ("twin_both", {"friction", "creep"}),
    ],
)
def test_each_twin_has_its_own_kind_of_hysteresis(name, kinds):
    for module in load_arm(name).modules:
        assert {
            kind
            for kind in ("backlash", "friction", "creep")
            if getattr(module.cable, kind) > 0
        } == kinds
