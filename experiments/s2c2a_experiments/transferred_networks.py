"""Networks transferred from another arm, on a short recording or on none."""

from dataclasses import dataclass

from s2c2a import strategies
from s2c2a.data import CollectOptions
from s2c2a.execution.progress import Progress
from s2c2a.jobs import NetworksArtifact, PriorNetworks, RecordingArtifact
from s2c2a.jobs.artifacts import Artifact, Cache, Networks, digest_of
from s2c2a.strategies import TrainedNetworks


@dataclass(frozen=True)
class TransferredNetworks(Networks):
    """Networks of an arm that start from those of another one.

    Attributes:
        arm: whose networks they are.
        recipe: how they are trained.
        seed: of the training.
        start: networks of the other arm, or a prior; None trains from nothing.
        options: of the recording to train on; None for none.
    """

    seed: int
    start: NetworksArtifact | PriorNetworks | None
    options: CollectOptions | None

    @property
    def needs(self) -> tuple[Artifact, ...]:
        needs: list[Artifact] = []
        if self.start is not None:
            needs.append(self.start)
        if self.options is not None:
            needs.append(RecordingArtifact(self.arm, self.options))
        return tuple(needs)

    @property
    def file(self) -> str:
        files = [need.file for need in self.needs]
        digest = digest_of(
            "transferred", *files, self.recipe.training, self.arm, self.seed
        )
        name = f"{self.arm.name}-{self.recipe.name}-transferred-seed{self.seed}"
        return f"{name}-{digest}.safetensors"

    def make(self, cache: Cache, progress: Progress) -> None:
        strategies.save_networks(self._networks(cache, progress), self.path(cache))

    def _networks(self, cache: Cache, progress: Progress) -> TrainedNetworks:
        start = None if self.start is None else self.start.load(cache)
        if self.options is None and start is not None:
            return strategies.transferred(start, self.arm, self.seed)
        recording = self.needs[-1].load(cache)
        return strategies.train_s2c2a(
            recording, self.recipe, self.seed, self.training_progress(progress), start
        )

    def __str__(self) -> str:
        start = "from nothing" if self.start is None else f"from {self.start.arm.name}"
        name = f"{self.recipe.name} networks of {self.arm.name}"
        return f"{name}, {start}, seed {self.seed}"
