"""Networks to start from: a prior over randomized arms."""

from dataclasses import dataclass, replace

from s2c2a import strategies
from s2c2a.arm import randomized_arm
from s2c2a.arm.randomized import MAX_STRENGTH
from s2c2a.data import CollectOptions
from s2c2a.errors import S2C2AError, counted
from s2c2a.execution.progress import Progress
from s2c2a.jobs.artifacts import Cache, Networks, RecordingArtifact, digest_of

FIRST_SEED = 1000
"""Of the randomized arms; evaluations use smaller ones."""


@dataclass(frozen=True)
class PriorNetworks(Networks):
    """Prior over randomized variants of an arm (`strategies.pretrain_s2c2a`).

    Attributes:
        arm: nominal arm, as training sees it.
        recipe: how the networks are trained.
        seed: of the training.
        arms: number of randomized arms, with seeds from `FIRST_SEED`.
        strength: of their mismatch.
        episodes: of each arm.
        samples: of each episode.
    """

    seed: int = 0
    arms: int = 24
    strength: float = 0.5
    episodes: int = 4
    samples: int = CollectOptions.samples

    def __post_init__(self):
        """Validate the options.

        Raises:
            S2C2AError: too few arms, or a strength out of range.
        """
        if self.arms < 2 or not 0 < self.strength <= MAX_STRENGTH:
            raise S2C2AError(
                f"a prior over {counted(self.arms, 'arm')} of strength "
                f"{self.strength:g} was asked for; give 2 arms or more and a strength "
                f"above 0, to {MAX_STRENGTH:g}"
            )

    @property
    def needs(self) -> tuple[RecordingArtifact, ...]:
        recordings = []
        for seed in range(FIRST_SEED, FIRST_SEED + self.arms):
            arm = randomized_arm(self.arm, seed, self.strength)
            usual = self.recipe.collect_options(seed)
            options = replace(usual, episodes=self.episodes, samples=self.samples)
            recordings.append(RecordingArtifact(arm, options))
        return tuple(recordings)

    @property
    def file(self) -> str:
        files = [need.file for need in self.needs]
        digest = digest_of(
            type(self), *files, self.arm, self.recipe.training, self.seed
        )
        name = f"{self.arm.name}-{self.recipe.name}-prior-seed{self.seed}"
        return f"{name}-{digest}.safetensors"

    def make(self, cache: Cache, progress: Progress) -> None:
        recordings = [need.load(cache) for need in self.needs]
        networks = strategies.pretrain_s2c2a(
            recordings,
            self.arm,
            self.recipe,
            self.seed,
            self.training_progress(progress),
        )
        strategies.save_networks(networks, self.path(cache))

    def __str__(self) -> str:
        return f"{self.recipe.name} prior over {self.arms} variants of {self.arm.name}"
