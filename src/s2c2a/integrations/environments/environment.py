"""The Gymnasium environment of one arm."""

from typing import Any

import numpy as np

from s2c2a.errors import S2C2AError, listed
from s2c2a.integrations.environments.simulation import SimulationBatch
from s2c2a.integrations.environments.spaces import MAX_VALUE
from s2c2a.integrations.environments.tasks import Family
from s2c2a.integrations.extras import needs_extra

with needs_extra("gym", "an environment"):
    import gymnasium


def action_space(batch: SimulationBatch) -> gymnasium.spaces.Box:
    """Space of the actions of one arm; see `spaces`."""
    return gymnasium.spaces.Box(-1.0, 1.0, (batch.controls.count,), np.float32)


def observation_space(batch: SimulationBatch) -> gymnasium.spaces.Box:
    """Space of the observations of one arm; see `spaces`."""
    shape = batch.observations().shape[1:]
    return gymnasium.spaces.Box(-MAX_VALUE, MAX_VALUE, shape, np.float32)


def refuse_options(options: dict[str, Any] | None) -> None:
    """Refuse options of a reset, which these environments would ignore.

    Raises:
        S2C2AError: there are some.
    """
    if options:
        raise S2C2AError(
            f"a reset has no options, and {listed([*options])} was given; a task class "
            "gives other goals (docs/guides/gymnasium.md)"
        )


class ArmEnv(gymnasium.Env):
    """One simulated arm with a task; actions and observations as in `spaces`.

    Args:
        task: name of a family of tasks (`tasks.FAMILIES`), or a class of your own.
        arm: preset, arm file, or description.
        render_mode: "rgb_array" or None.
        options: see `SimulationBatch`.

    Raises:
        S2C2AError: see `SimulationBatch`.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 10}  # noqa: RUF012

    def __init__(
        self,
        task: str | type[Family] = "Reach",
        arm: Any = "twin_arm",
        render_mode: str | None = None,
        **options: Any,
    ):
        self.batch = SimulationBatch(task, arm, **options)
        self.action_space = action_space(self.batch)
        self.observation_space = observation_space(self.batch)
        self.render_mode = render_mode

    def reset(self, *, seed: int | None = None, options: dict | None = None):
        """See `gymnasium.Env.reset`."""
        refuse_options(options)
        super().reset(seed=seed)
        self.batch.reset([0], [self.np_random], new_robots=seed is not None)
        return self.batch.observations()[0], {}

    def step(self, action):
        """See `gymnasium.Env.step`."""
        outcome = self.batch.step(np.asarray(action)[None])
        return (
            outcome.observations[0],
            float(outcome.rewards[0]),
            bool(outcome.terminated[0]),
            bool(outcome.truncated[0]),
            {"error": float(outcome.errors[0])},
        )

    def render(self):
        """See `gymnasium.Env.render`."""
        if self.render_mode != "rgb_array":
            return None
        from s2c2a.integrations.environments.picture import (  # noqa: PLC0415  # slow
            draw,
        )

        batch = self.batch
        return draw(batch.arm, batch.states(0), batch.goal(0), batch.obstacle(0))

    def close(self):
        """See `gymnasium.Env.close`."""
        self.batch.close()
