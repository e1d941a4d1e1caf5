"""The paper's planner in eager PyTorch: `nn.LSTM`, `backward()`, Adam, a Python loop.

The same objective, projection and limits as ours, so that both give the same plan.
Weights are frozen, and where no obstacle is in use none is looked at: PyTorch is not
made to do what the paper does not need.

Needs PyTorch; the extra `bench` brings it.
"""

from collections.abc import Callable, Sequence
from itertools import cycle
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.errors import StrategyError
from s2c2a.models import C2S
from s2c2a.paper import WORKSPACE_SHARE
from s2c2a.planning import Adam, Goal
from s2c2a.strategies import TrainedNetworks
from torch_networks import TorchC2S, tensor


class TorchGoal(NamedTuple):
    """`Goal` as tensors, without its obstacles."""

    positions: Tensor
    position_weights: Tensor
    axes: Tensor
    axis_weights: Tensor
    change_weight: Tensor

    @classmethod
    def of(cls, goal: Goal) -> "TorchGoal":
        """The same goal."""
        return cls(*(tensor(getattr(goal, name)) for name in cls._fields))


class TorchPlanner:
    """`Planner` for the paper's recipe without obstacles, kept on the sphere."""

    def __init__(self, arm: ArmSpec, model: C2S, solver: Adam):
        self._model = TorchC2S(model).requires_grad_(False)
        self._scale = WORKSPACE_SHARE * arm.length
        self._solver = solver
        self._bend_limits = tensor(ArmGeometry.of(arm).bend_limits)
        self._longest_step = torch.tensor(
            np.deg2rad(arm.step_limit_deg), dtype=torch.float32
        )

    def plan(self, last: Tensor, goal: TorchGoal) -> Tensor:
        """The next configuration after the last one, shape (modules, 3)."""
        configurations = last.clone().requires_grad_()
        optimizer = torch.optim.Adam([configurations], lr=self._solver.learning_rate)
        for _ in range(self._solver.iterations):
            optimizer.zero_grad()
            self._objective(configurations, last, goal).backward()
            optimizer.step()
            with torch.no_grad():
                configurations /= torch.linalg.norm(
                    configurations, dim=-1, keepdim=True
                )
        return self._within_limits(configurations.detach(), last)

    def _objective(
        self, configurations: Tensor, last: Tensor, goal: TorchGoal
    ) -> Tensor:
        """mu_p L_p + mu_o L_o + mu_d L_d (Chen et al. 2025, eq. (7))."""
        states = self._model(configurations[None])[0]
        apart = torch.linalg.norm(
            (goal.positions - states[:, :3]) / self._scale, dim=-1
        )
        turned = torch.linalg.norm(goal.axes - states[:, 3:], dim=-1)
        change = torch.linalg.norm(configurations - last)
        targets = torch.sum(goal.position_weights * apart) + torch.sum(
            goal.axis_weights * turned
        )
        return targets + goal.change_weight * change

    def _within_limits(self, desired: Tensor, last: Tensor) -> Tensor:
        start = _bends(last)
        change = _limited(_bends(desired), self._bend_limits) - start
        return _configurations(start + _limited(change, self._longest_step))


def planner_of(networks: TrainedNetworks) -> TorchPlanner:
    """The planner of the paper's recipe, on one thread."""
    torch.set_num_threads(1)
    solver = networks.recipe.planner.solver
    if not (isinstance(solver, Adam) and isinstance(networks.c2s, C2S)):
        raise StrategyError(
            f"the planner of the recipe '{networks.recipe.name}' is not the paper's; "
            "choose the recipe 'paper'"
        )
    return TorchPlanner(networks.arm, networks.c2s, solver)


def following(networks: TrainedNetworks, goals: Sequence[Goal]) -> Callable[[], Tensor]:
    """A call that plans for one goal after the other, each from the last plan."""
    planner = planner_of(networks)
    asked = cycle([TorchGoal.of(goal) for goal in goals])
    last = torch.tensor([[0.0, 0.0, 1.0]]).repeat(networks.arm.module_count, 1)

    def call() -> Tensor:
        nonlocal last
        last = planner.plan(last, next(asked))
        return last

    return call


def _bends(configurations: Float[Tensor, "modules 3"]) -> Float[Tensor, "modules 2"]:
    across = torch.linalg.norm(configurations[:, :2], dim=-1, keepdim=True)
    angle = torch.atan2(across, configurations[:, 2:])
    return configurations[:, :2] * torch.where(
        across > 1e-6, angle / across.clamp(min=1e-6), 1.0
    )


def _configurations(bends: Float[Tensor, "modules 2"]) -> Float[Tensor, "modules 3"]:
    angle = torch.linalg.norm(bends, dim=-1, keepdim=True)
    return torch.cat([bends * torch.sinc(angle / torch.pi), torch.cos(angle)], dim=-1)


def _limited(
    vectors: Float[Tensor, "modules 2"], longest: Tensor
) -> Float[Tensor, "modules 2"]:
    length = torch.linalg.norm(vectors, dim=-1)
    return vectors * torch.clamp(longest / length.clamp(min=1e-12), max=1.0)[:, None]
