"""Page of the columns of episodes: runs of strategies and recordings for training."""

from typing import NamedTuple

from s2c2a.planning import Outcome
from s2c2a.spaces import Stage

from tools.markdown import header, table

OPENING = """# Episode columns

An episode records one motion of an arm. It has one row for each control step, with the
reading before the action of the step. Runs, recordings and imported logs have the same
form. A file `.episodes` holds episodes of one arm, and its arm file.

```python
from s2c2a.episodes import load_episodes

episodes, options = load_episodes("twin.episodes")
episode = episodes[0]
print(episode["time"].shape, episode.sensors, list(episode.columns))
positions = episode.sensor("states")[:, -1, :3]  # of the tip [m], shape (steps, 3)
```

The first axis of every column is the steps; the tables give the shape of one row. A
quantity that was not measured, desired or planned has no column. NaN means that it is
missing in this step. Every episode has `time` and `actions`; imported logs have
`sensor.cables` and `sensor.states` besides. Modules count from the base.
[State, Configuration, Action](../concepts/spaces.md) defines the spaces,
[Notation](notation.md) the symbols and frames.
"""
RUN = """`run`, `sweep`, `reproduce` and `live` write runs. They have the columns above and these.
`Episode.running` gives the rows in which the arm followed its goal, `Episode.after(NAME)`
the readings after each of their actions, which scores use.
"""
OPTIONS = """## Options

`episode.options` and the options of a file are JSON values. They describe the data.
"""


class Column(NamedTuple):
    """A column of an episode.

    Attributes:
        name: of the column; `NAME` stands for a name of the arm.
        shape: of one row.
        unit: of its values.
        meaning: in words, with the frame.
    """

    name: str
    shape: str
    unit: str
    meaning: str


LOOP = (
    Column("time", "()", "s", "time of the reading since the robot was opened; rises"),
    Column(
        "actions",
        "(modules, cables)",
        "m or N",
        "action that was really sent, after all limits: displacement of each cable, "
        "positive where the cable gets longer, or tension",
    ),
    Column("stage", "()", "", "number of the stage of the control loop (below)"),
    Column(
        "feedback",
        "()",
        "1",
        "share of the feedback that the controller may use; vibration lowers it; 1 in "
        "recordings",
    ),
    Column(
        "tick_time",
        "()",
        "s",
        "time to estimate, plan and choose the action; not in recordings",
    ),
)
SENSORS = (
    Column(
        "sensor.cables",
        "(modules, cables)",
        "m or N",
        "cable displacements from the encoders, or tensions of a tension arm",
    ),
    Column(
        "sensor.states",
        "(modules, 6)",
        "m, 1",
        "true states, base frame: position and axis of each module's end, from motion "
        "capture or simulation; those of a tracker are moved to the time of the reading",
    ),
    Column(
        "sensor.states_age", "()", "s", "age of the tracked states when they were read"
    ),
    Column(
        "sensor.configurations",
        "(modules, 3)",
        "1",
        "true configurations, module frames, from simulation",
    ),
    Column(
        "sensor.tensions",
        "(modules, cables)",
        "N",
        "cable tensions from motor currents",
    ),
    Column(
        "sensor.center_line",
        "(samples, points, 3)",
        "m",
        "true center line, base to tip, base frame; newest sample last",
    ),
    Column(
        "sensor.accelerations",
        "(samples, modules, 3)",
        "m/s2",
        "inertial sensors at the module ends, in the frames there; up at rest",
    ),
    Column(
        "sensor.angular_velocities",
        "(samples, modules, 3)",
        "rad/s",
        "the same sensors",
    ),
    Column(
        "sensor.camera_positions",
        "(modules, 3)",
        "m",
        "positions of module ends in a camera image, base frame; NaN where an end is not "
        "visible and in steps without a new image",
    ),
    Column("sensor.camera_age", "()", "s", "age of that image when it was read"),
    Column("sensor.flex", "(modules, strips)", "rad", "bends from flex sensors"),
)
GOALS = (
    Column(
        "desired_positions",
        "(modules, 3)",
        "m",
        "desired positions of module ends, base frame; NaN without a target",
    ),
    Column(
        "desired_axes",
        "(modules, 3)",
        "1",
        "desired axes of module ends, base frame; NaN without a target",
    ),
    Column(
        "obstacles",
        "(obstacles, 4)",
        "m",
        "center (three values) and threshold of each obstacle, base frame; threshold 0 "
        "for an unused row",
    ),
    Column(
        "target_offsets",
        "(modules, 3)",
        "m",
        "offsets of the targets, learned in repetitions (`run --repeat`)",
    ),
)
ESTIMATES = (
    Column(
        "sensed",
        "(modules, 3)",
        "1",
        "estimated configurations, module frames: what the planner starts from",
    ),
    Column("payload", "()", "kg", "estimated or known payload at the tip"),
    Column(
        "bend_biases",
        "(modules, 2)",
        "rad",
        "estimated bend biases, the bends beside those that the forward model predicts",
    ),
    Column(
        "external_force",
        "()",
        "N",
        "force at the tip that would cause the bend biases",
    ),
    Column(
        "rejected.NAME",
        "()",
        "",
        "1 while the estimator rejects the sensor `NAME`, else 0",
    ),
)
PLANS = (
    Column("planned", "(modules, 3)", "1", "planned configurations, module frames"),
    Column(
        "predicted",
        "(modules, 6)",
        "m, 1",
        "states that the forward model predicts for the plan, base frame",
    ),
    Column(
        "predictive_std",
        "(modules,)",
        "m",
        "predictive standard deviation of the module ends; 0 if the model has none",
    ),
    Column(
        "extrapolation",
        "()",
        "m",
        "part of that deviation which is due to extrapolation beyond the data",
    ),
    Column("outcome", "()", "", "number of the planner's outcome (below)"),
    Column(
        "plan_error",
        "()",
        "m",
        "largest distance of the planned module ends from their desired positions, by "
        "the plan's own model; NaN without a desired position",
    ),
)
RUN_OPTIONS = (
    ("`task`, `strategy`, `recipe`, `seed`", "run", "what ran"),
    ("`robot`", "run, recording", "robot and its options, such as `simulation fast`"),
    ("`versions`", "run", "versions of the packages"),
    ("`late_steps`", "run", "number of control steps that began late"),
    ("`interrupted`", "run", "why a run of a real arm ended early"),
    ("`faults`", "run", "sentences of all faults that occurred"),
    ("`vibrations`", "run", "when each vibration was found, and what vibrates"),
    (
        "`babbling`, `episodes`, `samples`, `seed`, `slowest`, `fastest`, `active`",
        "file of a recording",
        "how the data were collected",
    ),
    (
        "`excluded_poses`",
        "recording of a real arm",
        "number of measured states that cannot be true, which are NaN",
    ),
    (
        "`frozen_poses`",
        "recording of a real arm",
        "number of those that repeat the last pose of a lost body",
    ),
)
GROUPS = {"Control loop": LOOP, "Sensors": SENSORS}
RUN_GROUPS = {"Goals": GOALS, "State estimates": ESTIMATES, "Plans": PLANS}


def all_columns() -> tuple[Column, ...]:
    """Every column that the page names."""
    return (*LOOP, *SENSORS, *GOALS, *ESTIMATES, *PLANS)


def episodes_page() -> str:
    """The page: columns of every episode, columns of runs, options."""
    parts = [header("tools/reference_episodes.py"), OPENING]
    parts.append("## Columns of recordings and runs\n")
    for heading, columns in GROUPS.items():
        parts += [f"### {heading}\n", _table(columns)]
    parts.append(
        "Robots can have more sensors; each has a column `sensor.NAME` with the shape "
        "that the robot declares.\n"
    )
    parts += ["## Columns of runs\n", RUN]
    for heading, columns in RUN_GROUPS.items():
        parts += [f"### {heading}\n", _table(columns)]
    parts += ["## Numbers of `stage`\n", _stages(), "## Numbers of `outcome`\n"]
    parts += [_outcomes(), OPTIONS]
    parts.append(table(("option", "in", "meaning"), RUN_OPTIONS))
    return "\n".join(parts)


def _table(columns: tuple[Column, ...]) -> str:
    rows = [
        (f"`{column.name}`", f"`{column.shape}`", column.unit, column.meaning)
        for column in columns
    ]
    return table(("column", "row", "unit", "meaning"), rows)


def _stages() -> str:
    rows = [(str(int(stage)), f"`{stage.name}`", str(stage)) for stage in Stage]
    return table(("number", "stage", "the arm is"), rows)


def _outcomes() -> str:
    rows = [(str(int(each)), f"`{each.name}`", each.sentence) for each in Outcome]
    return table(("number", "outcome", "meaning"), rows)
