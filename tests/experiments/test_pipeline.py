"""Small versions of the project's claims: one seed, fewer epochs, the same thresholds."""

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.experiments.controller_tracking import track_circle
from s2c2a.experiments.following import follow
from s2c2a.strategies import recipe_named, s2c2a_strategy

RECIPE = recipe_named("paper")


def errors_on_circle(name: str, trained, workshop) -> dict[str, float]:
    def make(controller: str, seed: int):
        if controller == "s2c2a":
            return s2c2a_strategy(trained[name])
        return workshop.strategy(controller, load_arm(name), RECIPE, seed)

    runs = follow("circle", load_arm(name), ("s2c2a", "pcc", "pcc-fitted"), [0], make)
    return {run.controller: float(run.errors.mean()) for run in runs}


def test_the_simulated_arm_follows_the_circle_as_well_as_the_papers(trained, workshop):
    assert errors_on_circle("simulated_arm", trained, workshop)["s2c2a"] <= 1.5


def test_on_the_twin_s2c2a_beats_pcc(trained, workshop):
    errors = errors_on_circle("twin_arm", trained, workshop)
    assert errors["s2c2a"] < errors["pcc"]
    assert errors["s2c2a"] <= 2.2


@pytest.mark.parametrize("name", ["twin_arm", "simulated_arm"])
def test_the_controller_learns_to_the_papers_held_out_error(name, trained):
    assert trained[name].percent["C2A"][0] <= 0.91


def test_the_forward_model_of_the_simulated_arm_errs_by_less_than_one_percent(trained):
    assert trained["simulated_arm"].percent["C2S"][0] <= 1.0


@pytest.mark.parametrize("name", ["twin_arm", "simulated_arm"])
@pytest.mark.parametrize("speed", [0.2, 1.0, 2.0])
def test_the_controller_tracks_unseen_references_without_diverging(name, speed, trained):
    errors = track_circle(trained[name], speed, seed=0, steps=400).errors
    assert errors.mean() <= 1.5
    assert errors[-100:].mean() <= 1.5 * max(errors[:100].mean(), 0.2)


def test_ticks_of_a_run_are_timed(trained, workshop):
    runs = follow(
        "circle",
        load_arm("twin_arm"),
        ("pcc",),
        [0],
        lambda c, s: workshop.strategy(c, trained["twin_arm"].arm, RECIPE, s),
    )
    assert np.all(runs[0].rollout.tick_times > 0)
