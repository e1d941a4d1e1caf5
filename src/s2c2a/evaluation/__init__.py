"""Evaluation: runs of strategies on tasks, their scores, and their reports."""

from s2c2a.evaluation.estimates import belief_said, said_of_belief
from s2c2a.evaluation.metrics import (
    METRICS,
    Scored,
    angles_deg,
    check_scores,
    position_errors,
    score_run,
    tilts_deg,
)
from s2c2a.evaluation.report import Row, said_of_plans
from s2c2a.evaluation.rollout import rollout
