"""Properties of every task: its name, reachable targets, and no jumps."""

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from s2c2a.arm import load_arm
from s2c2a.evaluation import METRICS
from s2c2a.planning import reach_gaps
from s2c2a.tasks import TASKS, Task, load_task

from marks import slow_after

TWIN = load_arm("twin_arm")
LIMIT_DEG = 50.0


def with_modules(**changes):
    """The twin with other modules."""
    modules = [module.model_copy(update=changes) for module in TWIN.modules]
    return TWIN.model_copy(update={"modules": tuple(modules)})


ARM = with_modules(bend_limit_deg=LIMIT_DEG)
"""Three modules of 0.2 m that bend by at most 50 deg."""
DOUBLE = with_modules(length=0.4)
FAST = TWIN.model_copy(update={"control_rate": 20.0})
PAPER = [
    "circle",
    "tilt-40",
    "tilt-50",
    "tilt-60",
    "tilt-0",
    "tilt-50-a20",
    "tilt-50-c20",
    "hold-base",
    "hold-middle",
    "hold-end",
    "reach-0",
    "reach-1",
    "reach-2",
    "risk-a",
    "risk-b",
    "risk-c",
    "flee",
    "follow",
]
OURS = ["square", "eight", "helix", "star"]
WITH_TARGET = [name for name in PAPER if name != "flee"] + OURS
STEPS = {"circle": 200, "tilt": 200, "hold": 200, "reach": 240, "risk": 240} | {
    "flee": 114,  # 1 + 3.4 + 2 + 3 + 2 s
    "follow": 698,
}
CLEARANCES = ["clearance", "clearance at steps", "clearance of the arm"]
TIP, NONE = (0, 0, 1), (0, 0, 0)
TARGETS = {
    "circle": (TIP, NONE, ["position"]),
    "tilt": (TIP, (0, 0, 2), ["position", "tilt"]),
    "hold-base": ((4, 0, 1), NONE, ["constraint 0", "position"]),
    "hold-middle": ((0, 1, 0), (0, 1, 0), ["constraint 1", "orientation 1"]),
    "hold-end": (TIP, TIP, ["constraint 2", "orientation 2"]),
    "reach-0": (TIP, NONE, ["end distance", "reached", "path length"]),
    "reach": (TIP, NONE, ["end distance", "reached", *CLEARANCES, "path length"]),
    "risk": (TIP, NONE, ["end distance", "reached", *CLEARANCES, "path length"]),
    "flee": (NONE, NONE, [*CLEARANCES, "stillness", "path length"]),
    "follow": (TIP, NONE, ["position", "recovery"]),
}
"""Weights of positions and axes of the modules, and scores, by (beginning of) name."""
MORE_THAN_A_POSITION = [name for name in PAPER if name.startswith(("tilt", "hold"))]


def test_the_tasks_are_those_of_the_protocol():
    assert sorted(TASKS) == sorted(PAPER + OURS)


@pytest.mark.parametrize("name", PAPER + OURS)
def test_a_task_has_its_name_and_scores_that_exist(name):
    task = load_task(name, TWIN)
    assert task.name == name
    assert name in OURS or len(task.goals) == STEPS[name.split("-")[0]]
    assert {score.metric for score in task.scores} <= set(METRICS)
    lengths = {len(score.steps) for score in task.scores if score.steps is not None}
    assert lengths <= {len(task.goals)}


@pytest.mark.parametrize("name", PAPER)
def test_weights_and_scores_are_those_of_the_protocol(name):
    task = load_task(name, TWIN)
    key = name if name in TARGETS else name.split("-")[0]
    positions, axes, scores = TARGETS[key]
    for goal in task.goals:
        assert tuple(goal.position_weights) == positions
        assert tuple(goal.axis_weights) == axes
        assert float(goal.change_weight) == 0.5
        assert float(goal.obstacle_weight) == 1.0
    asked = np.isfinite(task.desired_positions()).all(axis=(0, 2))
    np.testing.assert_array_equal(asked, np.array(positions) > 0)
    asked = np.isfinite(task.desired_axes()).all(axis=(0, 2))
    np.testing.assert_array_equal(asked, np.array(axes) > 0)
    ends = {-1: "", 0: " 0", 1: " 1", 2: " 2"}
    found = [score.metric + ends[score.module] for score in task.scores]
    assert (task.obstacles().shape[1] > 0) == ("clearance" in found)
    assert found == scores + ["azimuth"] * (name in ("tilt-50-a20", "tilt-50-c20"))


@pytest.mark.parametrize("name", PAPER + OURS)
def test_lengths_and_thresholds_scale_with_the_arm_and_angles_do_not(name):
    once, twice = load_task(name, TWIN), load_task(name, DOUBLE)
    for part in (Task.desired_positions, lambda task: task.obstacles()[..., :4]):
        np.testing.assert_allclose(part(twice), 2 * part(once), atol=2e-6)
    np.testing.assert_allclose(twice.desired_axes(), once.desired_axes(), atol=1e-6)


@pytest.mark.parametrize("name", [*MORE_THAN_A_POSITION, "circle", "flee", "reach-0"])
def test_a_faster_control_keeps_the_times(name):
    fast, task = load_task(name, FAST), load_task(name, TWIN)
    for part in (Task.desired_positions, Task.desired_axes, Task.obstacles):
        np.testing.assert_allclose(part(fast)[1::2], part(task), atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("name", WITH_TARGET)
def test_no_desired_position_jumps(name):
    """Once around at 0.22 m in 160 steps is the fastest: 8.6 mm a step."""
    desired = load_task(name, TWIN).desired_positions()
    asked = np.isfinite(desired[0, :, 0])
    rest = np.array([[0, 0, 0.2], [0, 0, 0.4], [0, 0, 0.6]])
    steps = np.diff(np.concatenate([rest[None], desired]), axis=0)
    moves = np.linalg.norm(steps, axis=-1)
    assert moves[:, asked].max() < 0.01


@pytest.mark.parametrize("name", WITH_TARGET)
def test_every_position_is_within_reach(name):
    """Within 0.1 cm (protocol); `follow` leaves the workspace in its last 168 steps."""
    desired = load_task(name, ARM).desired_positions()
    steps = np.linspace(0, min(len(desired), 698 - 168) - 1, 24).astype(int)
    modules = np.flatnonzero(np.isfinite(desired[0, :, 0]))
    gaps = [reach_gaps(ARM, desired[steps, module], int(module)) for module in modules]
    assert np.max(gaps) < 0.001


def states(bends, lengths):
    """States of a chain of arcs, shape (modules, 6), independent of the package."""
    frame, position, found = Rotation.identity(), np.zeros(3), []
    for (x, y), length in zip(bends, lengths, strict=True):
        angle = max(np.hypot(x, y), 1e-9)
        aside = (1 - np.cos(angle)) / angle**2
        way = [aside * x, aside * y, np.sin(angle) / angle]
        position = position + length * frame.apply(way)
        frame = frame * Rotation.from_rotvec([-y, x, 0.0])
        found.append([*position, *frame.apply([0.0, 0.0, 1.0])])
    return np.array(found)


def limited(values):
    """Bends below the limit, whatever the values, smoothly."""
    lengths = np.sqrt(1 + np.sum(values**2, axis=-1, keepdims=True))
    return np.deg2rad(LIMIT_DEG) * values / lengths


def misses(task, step, lengths):
    """Smallest position [m] and orientation [deg] errors, by least squares."""
    positions, axes = task.desired_positions()[step], task.desired_axes()[step]
    placed, pointed = np.isfinite(positions[:, 0]), np.isfinite(axes[:, 0])

    def gaps(values):
        ends = states(limited(values.reshape(-1, 2)), lengths)
        return (ends[:, :3] - positions)[placed], (ends[:, 3:] - axes)[pointed]

    def residuals(values):
        apart, turned = gaps(values)
        return np.concatenate([apart.ravel(), 0.1 * turned.ravel(), 1e-7 * values])

    random = np.random.default_rng(step)
    starts = random.uniform(-1, 1, (4, 2 * len(lengths)))
    found = [least_squares(residuals, start) for start in starts]
    apart, turned = gaps(min(found, key=lambda one: one.cost).x)
    angles = np.rad2deg(np.linalg.norm(turned, axis=-1))
    return np.linalg.norm(apart, axis=-1).max(), angles.max(initial=0.0)


@pytest.mark.slow
@pytest.mark.parametrize("name", MORE_THAN_A_POSITION)
@pytest.mark.parametrize("step", slow_after(1, [104, 19, 39, 199]))
def test_all_targets_of_a_step_are_within_reach_together(name, step):
    """Within 0.1 cm and 0.2 deg (protocol)."""
    apart, turned = misses(load_task(name, ARM), step, [0.2, 0.2, 0.2])
    assert apart < 0.001
    assert turned < 0.2
