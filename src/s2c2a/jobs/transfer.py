"""Networks that were begun from those of another arm, on a short recording or on none."""

from dataclasses import dataclass, replace

from s2c2a import strategies
from s2c2a.arm import ArmSpec
from s2c2a.data import CollectOptions
from s2c2a.jobs.artifacts import (
    Artifact,
    Cache,
    NetworksArtifact,
    RecordingArtifact,
    digest_of,
)
from s2c2a.progress import Progress
from s2c2a.strategies import Recipe, TrainedNetworks


@dataclass(frozen=True)
class BegunNetworks(Artifact[TrainedNetworks]):
    """Both networks of an arm.

    Attributes:
        arm: whose they are.
        recipe: how they are trained.
        seed: of training.
        start: of another arm, that they begin from; None for from nothing.
        options: of the recording that they learn from; None for none.
    """

    kind = "networks"
    arm: ArmSpec
    recipe: Recipe
    seed: int
    start: NetworksArtifact | None
    options: CollectOptions | None

    @property
    def needs(self) -> tuple[Artifact, ...]:
        """See `Artifact`."""
        recording = (
            None if self.options is None else RecordingArtifact(self.arm, self.options)
        )
        return tuple(one for one in (self.start, recording) if one)

    @property
    def file(self) -> str:
        """See `Artifact`."""
        digest = digest_of(
            "begun",
            *(one.file for one in self.needs),
            self.recipe.training,
            self.arm.name,
            self.seed,
        )
        return f"{self.arm.name}-{self.recipe.name}-begun-seed{self.seed}-{digest}.safetensors"

    def make(self, cache: Cache, progress: Progress) -> None:
        """See `Artifact`."""
        strategies.save_strategy(self._networks(cache, progress), self.path(cache))

    def _networks(self, cache: Cache, progress: Progress) -> TrainedNetworks:
        def told(network: str, epoch: int, most: int, loss: float) -> None:
            progress(f"training {network} of {self}", epoch, most)

        start = self.start.load(cache) if self.start else None
        if self.options is None and start:
            return strategies.transferred(start, self.arm, self.seed)
        recording = self.needs[-1].load(cache)
        return strategies.train_s2c2a(recording, self.recipe, self.seed, told, start)

    def load(self, cache: Cache) -> TrainedNetworks:
        """See `Artifact`."""
        return replace(
            strategies.load_strategy(self.path(cache), self.arm), recipe=self.recipe
        )

    def __str__(self) -> str:
        start = f"from {self.start.arm.name}" if self.start else "from nothing"
        return (
            f"{self.recipe.name} networks of {self.arm.name}, {start}, seed {self.seed}"
        )
