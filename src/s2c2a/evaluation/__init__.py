"""Evaluation: runs of strategies on tasks, their scores, and their reports."""

from s2c2a.evaluation.estimates import describe_estimates, describe_step_estimates
from s2c2a.evaluation.extrapolation import describe_extrapolation, is_outside_data
from s2c2a.evaluation.lasting_error import describe_lasting_error, describe_step_plan
from s2c2a.evaluation.metrics import (
    METRICS,
    ScoreResult,
    angles_deg,
    check_scores,
    curve_distances,
    position_errors,
    score_run,
    tilts_deg,
)
from s2c2a.evaluation.report import (
    Row,
    describe_faults,
    describe_jumps_of_frame,
    describe_lost_states,
    describe_plans,
    describe_touches,
    describe_tracking,
)
from s2c2a.evaluation.rollout import repeated_rollout, rollout
from s2c2a.evaluation.saturation import describe_run_saturation, describe_saturation
from s2c2a.evaluation.session_report import (
    DisagreementWatch,
    describe_disagreement,
    describe_session,
)
from s2c2a.evaluation.training_report import (
    describe_controller,
    describe_held_out_errors,
    describe_modal_model,
)
