"""Letting strategies work on tasks, and scoring them."""

from s2c2a.evaluation.metrics import position_errors
from s2c2a.evaluation.rollout import Rollout, rollout
from s2c2a.evaluation.scoring import METRICS, Scored, score_run

__all__ = ["METRICS", "Rollout", "Scored", "position_errors", "rollout", "score_run"]
