"""What a sweep varies and writes belongs to the strategy that it tries."""

import pytest

from s2c2a.arm import load_arm
from s2c2a.errors import S2C2AError
from s2c2a.execution.progress import quiet
from s2c2a.jobs import Cache
from s2c2a.strategies import STRATEGIES, load_recipe, recipe_named
from s2c2a.tasks import load_task
from s2c2a_experiments import sweep
from s2c2a_experiments.search_space import varied_from

TWIN = load_arm("twin_arm")
BEST = recipe_named("best")
VARIED = varied_from(["planner.solver.iterations=5,10"], BEST)
TRIALS = [sweep.Trial(0, {"planner.solver.iterations": 5}, 1.0)]


# the others use no key of a recipe, so nothing can vary
PLANNING = list(STRATEGIES.known)


@pytest.mark.parametrize("strategy", PLANNING)
def test_the_networks_of_the_best_trial_are_those_of_its_runs(
    strategy, tmp_path, monkeypatch
):
    tasks = (load_task("circle", TWIN),)
    plan = sweep.Sweep(TWIN, tasks, BEST, VARIED, seeds=(2, 3), strategy=strategy)
    needed = plan.jobs(sweep.best_of(TRIALS).values)[0].needs
    asked = []
    saved = []

    class Networks:
        recipe = BEST

    monkeypatch.setattr(
        sweep, "made", lambda artifact, *_: asked.append(artifact) or Networks()
    )
    monkeypatch.setattr(sweep, "replace", lambda value, **_: value)
    monkeypatch.setattr(sweep, "save_networks", lambda _, path: saved.append(path))
    recipe, weights = sweep.save_best(TRIALS, plan, tmp_path, Cache(tmp_path), quiet)
    assert tuple(asked) == needed
    assert load_recipe(recipe).planner.solver.iterations == 5
    assert saved == ([] if strategy == "pcc" else [weights])
    for artifact in needed:
        assert STRATEGIES.name_of(type(artifact.strategy)) == strategy


@pytest.mark.parametrize("place", ["c2s.hidden", "planner.solver.iterations"])
@pytest.mark.parametrize("name", STRATEGIES.known)
def test_a_sweep_varies_what_its_strategy_uses(name, place):
    tasks = (load_task("circle", TWIN),)
    varied = varied_from([f"{place}=16,32"], BEST)
    if place.partition(".")[0] in STRATEGIES.named(name).recipe_keys:
        assert sweep.Sweep(TWIN, tasks, BEST, varied, strategy=name)
        return
    with pytest.raises(S2C2AError, match=f"--vary {place} would have no effect"):
        sweep.Sweep(TWIN, tasks, BEST, varied, strategy=name)
