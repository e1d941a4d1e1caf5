"""Training of both networks of a recipe; `--device gpu` for a GPU."""

import pytest

from s2c2a.execution.executors import limit_jax_to_one_thread
from s2c2a.jobs import Cache, RecordingArtifact, made
from s2c2a.strategies import recipe_named, train_s2c2a

pytestmark = pytest.mark.cores(2)


@pytest.fixture(scope="module", autouse=True)
def _one_thread():
    # as whatever trains does; heeded until JAX's first computation
    limit_jax_to_one_thread()


@pytest.mark.asked("at most 60 s")
@pytest.mark.parametrize("recipe", ["best", "paper"])
def test_train(benchmark, arm, recipe):
    """Until training stops early, with what compiling takes."""
    chosen = recipe_named(recipe)
    recording = made(RecordingArtifact(arm, chosen.collect_options()), Cache())
    networks = benchmark.pedantic(train_s2c2a, args=(recording, chosen, 0))
    for name, trained in networks.trained.items():
        if len(trained.curve):
            benchmark.extra_info[f"epochs of {name}"] = len(trained.curve)
