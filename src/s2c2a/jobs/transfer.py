"""Networks transferred from another arm, on a short recording or on none."""

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
from s2c2a.jobs.prior import PriorNetworks
from s2c2a.progress import Progress
from s2c2a.strategies import Recipe, TrainedNetworks


@dataclass(frozen=True)
class TransferredNetworks(Artifact[TrainedNetworks]):
    """Networks of an arm that start from those of another one.

    Attributes:
        arm: whose networks they are.
        recipe: how they are trained.
        seed: of the training.
        start: networks of the other arm, or a prior; None trains from nothing.
        options: of the recording to train on; None for none.
    """

    kind = "networks"
    strategy = "s2c2a"
    arm: ArmSpec
    recipe: Recipe
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
        def training_progress(
            network: str, epoch: int, epochs: int, loss: float
        ) -> None:
            progress(f"training {network} of {self}", epoch, epochs)

        start = None if self.start is None else self.start.load(cache)
        if self.options is None and start is not None:
            return strategies.transferred(start, self.arm, self.seed)
        recording = self.needs[-1].load(cache)
        return strategies.train_s2c2a(
            recording, self.recipe, self.seed, training_progress, start
        )

    def load(self, cache: Cache) -> TrainedNetworks:
        networks = strategies.load_networks(self.path(cache), self.arm)
        return replace(networks, recipe=self.recipe)

    def __str__(self) -> str:
        start = "from nothing" if self.start is None else f"from {self.start.arm.name}"
        name = f"{self.recipe.name} networks of {self.arm.name}"
        return f"{name}, {start}, seed {self.seed}"
