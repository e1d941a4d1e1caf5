"""Letting strategies work on tasks, and scoring them."""

from s2c2a.evaluation.metrics import position_errors
from s2c2a.evaluation.rollout import Rollout, rollout

__all__ = ["Rollout", "position_errors", "rollout"]
