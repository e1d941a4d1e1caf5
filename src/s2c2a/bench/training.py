"""Training both networks: seconds an epoch and to the stop, with PyTorch's epochs in between."""

import time
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from s2c2a.bench.extras import MissingExtraError, module_with
from s2c2a.bench.measurement import Limit, Measurement, Skipped, ratio, timing
from s2c2a.bench.options import BenchOptions
from s2c2a.bench.timing import Progress
from s2c2a.data import CollectOptions, Recording
from s2c2a.experiments.workshop import Workshop
from s2c2a.shards import all_cores, compute_on_one_thread
from s2c2a.strategies import Recipe, TrainedNetworks, recipe_named, train_s2c2a

STOP_LIMIT, FASTER = Limit(60.0), Limit(1.5, at_least=True)


@dataclass
class Course:
    """How the training of one network went.

    Attributes:
        epochs: trained.
        seconds: an epoch, one number for every call of ours [s]; the first holds the compilation.
        torch: an epoch of PyTorch [s].
        threads: that PyTorch is fastest with.
    """

    epochs: int = 0
    seconds: list[float] = field(default_factory=list)
    torch: list[float] = field(default_factory=list)
    threads: int = 0

    @property
    def compiled(self) -> np.ndarray:
        """Seconds an epoch, the call that compiles left out [s]."""
        return np.array(self.seconds[1:] or self.seconds)

    @property
    def torch_to_stop(self) -> float:
        """What as many epochs take PyTorch, by the median of those that were trained [s]."""
        return self.epochs * float(np.median(self.torch))


def measure(options: BenchOptions, progress: Progress) -> Iterator[Measurement | Skipped]:
    """The paper's recipe with PyTorch beside it, and `best`, whose forward model PyTorch has nothing like."""
    compute_on_one_thread()  # as `train`, `run` and every process of a crew do
    workshop = Workshop(progress=progress)
    for name in ("paper", "best"):
        recipe = _cut_short(recipe_named(name)) if options.quick else recipe_named(name)
        recording = workshop.recording(options.arm, CollectOptions(seed=options.seed, speeds=recipe.speeds))
        yield from training(recording, recipe, options, progress, beside=name == "paper")


def _cut_short(recipe: Recipe) -> Recipe:
    """The recipe with a few epochs of each network."""
    c2s, c2a = (replace(fit, most_epochs=2 * fit.epochs_per_call) for fit in (recipe.c2s_fit, recipe.c2a_fit))
    return replace(recipe, c2s_fit=c2s, c2a_fit=c2a)


def training(
    recording: Recording, recipe: Recipe, options: BenchOptions, progress: Progress, beside: bool
) -> Iterator[Measurement | Skipped]:
    """Train as a user would; between our calls PyTorch trains an epoch, or as many as we did if `whole`."""
    rivals = {}
    if beside:
        try:
            rivals = module_with("torch", "torch_training").trainings(recording, recipe, options.seed)
        except MissingExtraError as missing:
            yield Skipped("training in PyTorch", str(missing))
    courses, total, networks = _train(recording, recipe, options, progress, rivals)
    for network, course in courses.items():
        yield timing(f"an epoch of {network}, {recipe.name}", course.compiled)
        if course.torch:
            yield timing(f"an epoch of {network}, PyTorch on {course.threads} thread(s)", np.array(course.torch))
            yield ratio(f"an epoch of {network}: PyTorch over ours", np.array(course.torch), course.compiled)
    yield _to_stop(recipe, courses, total, networks)
    if rivals:
        yield from _beside_to_stop(courses, total)


def _train(
    recording: Recording, recipe: Recipe, options: BenchOptions, progress: Progress, rivals: dict
) -> tuple[dict[str, Course], float, TrainedNetworks]:
    """The course of both trainings, seconds of ours together, and what was trained."""
    courses = {name: Course() for name in ("C2S", "C2A")}
    for name, rival in rivals.items():
        courses[name].threads = rival.take_best_threads(all_cores())
    resumed = began = time.perf_counter()

    def told(network: str, epoch: int, most: int, loss: float) -> None:
        nonlocal resumed
        course, new = courses[network], epoch - courses[network].epochs
        course.seconds.append((time.perf_counter() - resumed) / new)
        course.epochs = epoch
        if network in rivals:
            module_with("torch", "torch_training").use_threads(course.threads)
            course.torch += [rivals[network].epoch() for _ in range(new if options.whole else 1)]
        progress(f"training {network}, {recipe.name}", epoch, most)
        resumed = time.perf_counter()

    networks = train_s2c2a(recording, recipe, options.seed, told)
    total = time.perf_counter() - began - sum(sum(course.torch) for course in courses.values())
    return courses, total, networks


def _to_stop(recipe: Recipe, courses: dict[str, Course], total: float, networks: TrainedNetworks) -> Measurement:
    course = ", ".join(
        f"{name} {course.epochs} epochs to {networks.percent[name][0]:.2f} %" for name, course in courses.items()
    )
    return timing(f"both networks to their stop, {recipe.name}", np.array([total]), STOP_LIMIT, course)


def _beside_to_stop(courses: dict[str, Course], total: float) -> Iterator[Measurement]:
    trained, wanted = (
        sum(values) for values in zip(*((len(c.torch), c.epochs) for c in courses.values()), strict=True)
    )
    how = "trained whole" if trained == wanted else f"epochs times their median, {trained} of {wanted} trained"
    seconds = np.array([sum(course.torch_to_stop for course in courses.values())])
    yield timing("as many epochs in PyTorch", seconds, note=how)
    yield ratio("to the stop: PyTorch over ours", seconds, np.array([total]), FASTER, "ours with compilation")
