"""Training of both networks, then PyTorch's epochs; `--device gpu` for a GPU."""

import time
from importlib import import_module
from importlib.util import find_spec

import numpy as np
import pytest

from s2c2a.execution.executors import all_cores, limit_jax_to_one_thread
from s2c2a.jobs import Cache, RecordingArtifact, made
from s2c2a.strategies import Recipe, recipe_named, train_s2c2a

pytestmark = pytest.mark.cores(2)
EPOCHS = 20  # that PyTorch trains of each network


@pytest.fixture(scope="module", autouse=True)
def _one_thread():
    # as whatever trains does; heeded until JAX's first computation
    limit_jax_to_one_thread()


class Course:
    """Epochs of each network, and what an epoch took [s], as training reports them."""

    def __init__(self):
        self.epochs = {"C2S": 0, "C2A": 0}
        self.seconds = {"C2S": [], "C2A": []}
        self._resumed = time.perf_counter()

    def on_epoch(self, network: str, epoch: int, most: int, loss: float) -> None:
        """One call of ours is several epochs."""
        now = time.perf_counter()
        self.seconds[network].append(
            (now - self._resumed) / (epoch - self.epochs[network])
        )
        self.epochs[network] = epoch
        self._resumed = now

    def an_epoch(self, network: str) -> float:
        """The call that compiles left out [s]."""
        return float(np.median(self.seconds[network][1:] or self.seconds[network]))


def trained(benchmark, arm, recipe: Recipe) -> tuple:
    """Train once; the recording, and the course of the training."""
    recording = made(RecordingArtifact(arm, recipe.collect_options()), Cache())
    course = Course()
    networks = benchmark.pedantic(
        train_s2c2a, args=(recording, recipe, 0, course.on_epoch)
    )
    for name, epochs in course.epochs.items():
        benchmark.extra_info[f"epochs of {name}"] = (
            f"{epochs} to {networks.trained[name].percent[0]:.2f} %"
        )
        benchmark.extra_info[f"one of {name} [s]"] = course.an_epoch(name)
    return recording, course


@pytest.mark.asked("at most 60 s")
def test_both_networks_to_their_stop(benchmark, arm):
    """The forward model of `best` is nothing that PyTorch has."""
    trained(benchmark, arm, recipe_named("best"))


@pytest.mark.asked("at most 60 s; as many epochs in PyTorch at least 1.5 times as long")
def test_both_networks_of_the_paper_to_their_stop(benchmark, arm):
    recipe = recipe_named("paper")
    recording, course = trained(benchmark, arm, recipe)
    if find_spec("torch") is None:
        benchmark.extra_info["PyTorch"] = "is not installed: `pip install '.[bench]'`"
        return
    whole = 0.0
    for name, rival in (
        import_module("torch_training").trainings(recording, recipe, 0).items()
    ):
        threads = rival.take_best_threads(all_cores())
        an_epoch = float(np.median([rival.epoch() for _ in range(EPOCHS)]))
        benchmark.extra_info[f"PyTorch, one of {name}"] = (
            f"{an_epoch:.4g} s on {threads} thread(s)"
        )
        whole += course.epochs[name] * an_epoch
    benchmark.extra_info["as many epochs in PyTorch [s]"] = whole
    if benchmark.stats:
        benchmark.extra_info["PyTorch over ours"] = whole / benchmark.stats.stats.median
