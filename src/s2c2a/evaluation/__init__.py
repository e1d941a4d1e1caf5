"""Letting strategies work on tasks, and scoring them."""

from s2c2a.evaluation.metrics import position_errors
from s2c2a.evaluation.rollout import rollout
from s2c2a.evaluation.scoring import METRICS, Outcome, Scored, score_run
