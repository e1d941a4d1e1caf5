"""The twin arms beside the printed numbers."""

import pytest

from s2c2a.arm import load_arm
from s2c2a.data import CollectOptions
from s2c2a.evaluation import position_errors, rollout
from s2c2a.jobs import RecordingArtifact, made
from s2c2a.planning import PAPER
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.strategies import pcc_strategy
from s2c2a.tasks import load_task
from s2c2a_experiments.workspace import ESTIMATION, WORKSPACE, measured


@pytest.mark.slow
def test_estimation_errors_and_workspace_of_the_twin_match_the_paper(cache):
    artifact = RecordingArtifact(load_arm("twin_arm"), CollectOptions(episodes=6))
    values = measured(made(artifact, cache))
    for claims, tolerance in ((ESTIMATION, 0.25), (WORKSPACE, 0.15)):
        for claim in claims:
            printed = pytest.approx(claim.paper, rel=tolerance)
            assert values[claim.quantity] == printed


@pytest.mark.slow
def test_pcc_errs_on_the_twin_as_on_the_papers_arm():
    arm = load_arm("twin_arm")
    task = load_task("circle", arm)
    run = rollout(SimulatedRobot(arm), pcc_strategy(arm, PAPER), task)
    errors = position_errors(run.after("states"), task.desired_positions())
    assert errors.mean() == pytest.approx(2.5, rel=0.3)


HYSTERESIS = ("backlash", "friction", "creep")


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
        sizes = {name: getattr(module.cable, name) for name in HYSTERESIS}
        assert {name for name, size in sizes.items() if size > 0} == kinds
