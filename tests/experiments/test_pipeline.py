"""Small versions of the project's claims: one seed, fewer epochs, same thresholds."""

import pytest

from s2c2a.jobs import GivenNetworks, jobs_for, make_all, score_rows
from s2c2a.strategies import TrainedNetworks, save_networks
from s2c2a_experiments.calibration import C2S_ERROR
from s2c2a_experiments.circle import track_reference


def errors_on_circle(
    networks: TrainedNetworks, cache, *strategies: str
) -> dict[str, float]:
    path = (
        cache.folder / f"{networks.recipe.name}-{networks.arm.name}-given.safetensors"
    )
    save_networks(networks, path)
    given = GivenNetworks.read(path, networks.arm)
    runs = make_all(
        jobs_for(
            ["circle"], networks.arm, strategies, [0], given.recipe, weights=given
        ),
        cache,
    )
    assert all((run.episode.ran("tick_time") > 0).all() for run in runs)
    rows = score_rows("circle", runs)
    assert [(row.strategy, row.metric, row.unit) for row in rows] == [
        (name, "position", "cm") for name in strategies
    ]
    return {row.strategy: row.mean for row in rows}


@pytest.mark.slow
def test_on_the_twin_s2c2a_beats_pcc_and_what_pcc_can_be_fitted_to(trained, cache):
    errors = errors_on_circle(trained["twin_arm"], cache, "s2c2a", "pcc", "pcc-fitted")
    assert errors["s2c2a"] <= 1.0
    assert errors["s2c2a"] < errors["pcc"]
    assert errors["s2c2a"] < errors["pcc-fitted"]


@pytest.mark.parametrize("name", ["twin_arm", "simulated_arm"])
def test_the_controller_learns_to_the_papers_held_out_error(name, trained):
    assert trained[name].trained["C2A"].percent[0] <= 0.91


@pytest.mark.slow
def test_the_twins_forward_model_errs_as_the_papers(trained_as_the_paper):
    assert C2S_ERROR.holds(trained_as_the_paper.trained["C2S"].percent[0])


@pytest.mark.parametrize("name", ["twin_arm", "simulated_arm"])
def test_the_forward_model_errs_by_less_than_one_percent(name, trained):
    assert trained[name].trained["C2S"].percent[0] <= 1.0


@pytest.mark.slow
@pytest.mark.parametrize("name", ["twin_arm", "simulated_arm"])
@pytest.mark.parametrize("speed", [0.2, 1.0, 2.0])
def test_the_controller_tracks_unseen_references_without_diverging(
    name, speed, trained
):
    errors = track_reference(trained[name], speed, steps=400)
    assert errors.mean() <= 1.5
    assert errors[-100:].mean() <= 1.5 * max(errors[:100].mean(), 0.2)
