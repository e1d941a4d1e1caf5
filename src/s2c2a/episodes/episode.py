"""Episodes: recordings of an arm from data collection, runs or imports."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmSpec
from s2c2a.errors import RecordingError, counted
from s2c2a.goals import PREVIEW
from s2c2a.obstacles import CORE, ROW
from s2c2a.spaces import Stage

SENSOR = "sensor."
MAX_COLUMNS = 256  # ten times those of a run; a file may be a stranger's


@dataclass(frozen=True, eq=False)  # arrays have no single truth value for ==
class Episode:
    """Columns with one row a control step; a row has the reading before its action.

    A quantity that was not measured, desired or planned has no column. These columns
    have the same meaning in every episode:

    | column              | meaning                               | row shape         |
    | ------------------- | ------------------------------------- | ----------------- |
    | `time`              | time of the reading since opening [s] |                   |
    | `actions`           | actions sent [m or N]                 | (modules, cables) |
    | `sensor.NAME`       | values of a sensor (`spaces.Reading`) | the sensor's      |
    | `stage`             | number of the stage (`spaces.Stage`)  |                   |
    | `sensed`, `planned` | configurations                        | (modules, 3)      |
    | `predicted`         | predicted states of the plan [m, 1]   | (modules, 6)      |
    | `predictive_std`    | predictive std. deviation of ends [m] | (modules,)        |
    | `extrapolation`     | part of it due to extrapolation [m]   |                   |
    | `outcome`           | number of the planner's `Outcome`     |                   |
    | `plan_error`        | of the plan's ends from the goal [m]  |                   |
    | `horizon`           | tip that is planned ahead [m]         | (PREVIEW, 3)      |
    | `target_offsets`    | learned in repetitions [m]            | (modules, 3)      |
    | `payload`           | estimated payload at the tip [kg]     |                   |
    | `bend_biases`       | estimated bend biases [rad]           | (modules, 2)      |
    | `external_force`    | external force that explains them [N] |                   |
    | `rejected.NAME`     | one if a sensor was rejected          |                   |
    | `desired_positions` | base frame [m]; NaN without a target  | (modules, 3)      |
    | `desired_axes`      | base frame [1]; NaN without a target  | (modules, 3)      |
    | `obstacles`         | centers and thresholds [m]; 0: unused | (obstacles, 4)    |
    |                     | with cores, where not all are spheres | (obstacles, 12)   |
    | `tick_time`         | time to sense, plan and send [s]      |                   |

    Attributes:
        arm: description of the arm.
        columns: name -> values, all with as many steps.
        options: metadata as JSON values: task, strategy, seed, robot, versions, ....

    Raises:
        RecordingError: columns have different lengths, `time` or `actions` is missing,
            times do not rise, values are not finite where they must be, or shapes do
            not fit the arm.
    """

    arm: ArmSpec
    columns: Mapping[str, np.ndarray]
    options: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self):
        """Make the columns read-only and check them."""
        columns = {
            name: _read_only(name, values) for name, values in self.columns.items()
        }
        object.__setattr__(self, "columns", columns)
        missing = {"time", "actions"} - set(columns)
        if missing:
            raise RecordingError(
                f"an episode needs {' and '.join(sorted(missing))}; "
                f"it has {', '.join(columns)}"
            )
        lengths = {values.shape[:1] for values in columns.values()}
        if len(columns) > MAX_COLUMNS or len(lengths) > 1:
            raise RecordingError(
                "an episode's columns must have as many steps each, "
                f"at most {MAX_COLUMNS} of them"
            )
        for name, shape in _standard_row_shapes(self.arm, columns).items():
            if name in columns and columns[name].shape[1:] != shape:
                raise RecordingError(
                    f"column '{name}' is of shape {columns[name].shape[1:]} a step; "
                    f"on '{self.arm.name}' it is {shape}"
                )
        for name in ("time", "actions"):
            if not np.isfinite(columns[name]).all():
                raise RecordingError(
                    f"column '{name}' holds numbers that are not finite"
                )
        if (np.diff(columns["time"]) <= 0).any():
            raise RecordingError("the times of an episode must rise from step to step")

    def __repr__(self) -> str:
        """Task, size and columns, whose values are too many to read."""
        return (
            f"<Episode of {self.options.get('task', 'motion')} on {self.arm.name}: "
            f"{counted(len(self), 'step')}, {np.diff(self['time']).sum():.1f} s; "
            f"columns {', '.join(self.columns)}>"
        )

    def __len__(self) -> int:
        """Return the number of steps."""
        return len(self.columns["time"])

    def __getitem__(self, name: str) -> np.ndarray:
        """Return a column; its first axis is the steps.

        Raises:
            RecordingError: there is no such column.
        """
        if name not in self.columns:
            raise RecordingError(
                f"this episode has no '{name}'; it has {', '.join(self.columns)}"
            )
        return self.columns[name]

    def get(self, name: str) -> np.ndarray | None:
        """Return a column, or None if there is no such column."""
        return self.columns.get(name)

    def sensor(self, name: str) -> np.ndarray:
        """Return the values of a sensor before each action.

        Raises:
            RecordingError: there is no such sensor.
        """
        return self[SENSOR + name]

    @property
    def sensors(self) -> list[str]:
        """Names of the sensors, sorted."""
        columns = [name for name in self.columns if name.startswith(SENSOR)]
        return sorted(name.removeprefix(SENSOR) for name in columns)

    @property
    def running(self) -> np.ndarray:
        """Indices of the steps in stage RUN or HOLD; all steps without stages."""
        stage = self.get("stage")
        if stage is None:
            return np.arange(len(self))
        return np.flatnonzero(np.isin(stage, (Stage.RUN, Stage.HOLD)))

    def after(self, name: str) -> np.ndarray:
        """Return the values of a sensor after each action of the run.

        Scores compare these values with the goals.

        Raises:
            RecordingError: there is no such sensor, or no reading after the last action
                of the run.
        """
        values = self.sensor(name)
        steps = self.running + 1
        if len(steps) and steps[-1] >= len(values):
            raise RecordingError(
                "nothing was read after the last action of this episode; "
                "record one step more"
            )
        return values[steps]

    def ran(self, name: str) -> np.ndarray:
        """Return a column in the steps of the run."""
        return self[name][self.running]

    def times(self) -> Float[np.ndarray, " steps"]:
        """Return the times of the readings after each action of the run [s]."""
        return self["time"][np.minimum(self.running + 1, len(self) - 1)]

    def with_options(self, **options: Any) -> "Episode":
        """Return the episode with more options."""
        return replace(self, options={**self.options, **options})


def stacked(episodes: Iterable[Episode], name: str) -> np.ndarray:
    """Stack a column of episodes, shape (episodes, steps, ...).

    Shorter episodes repeat their last row.

    Raises:
        RecordingError: an episode has no such column, or rows have different shapes.
    """
    columns = [episode[name] for episode in episodes]
    if len({values.shape[1:] for values in columns}) != 1:
        shapes = sorted({values.shape for values in columns})
        raise RecordingError(f"'{name}' has shapes {shapes} in these episodes, not one")
    longest = max(map(len, columns))
    padded = []
    for values in columns:
        padding = np.repeat(values[-1:], longest - len(values), axis=0)
        padded.append(np.concatenate([values, padding]))
    return np.stack(padded)


def sensor_shapes(arm: ArmSpec) -> dict[str, tuple[int, ...]]:
    """Shapes of those sensors that have the same meaning in every episode, by name."""
    modules = arm.module_count
    return {
        "cables": (modules, arm.cable_count),
        "states": (modules, 6),
        "configurations": (modules, 3),
    }


def _standard_row_shapes(
    arm: ArmSpec, columns: Mapping[str, np.ndarray]
) -> dict[str, tuple[int, ...]]:
    modules = arm.module_count
    cables = (modules, arm.cable_count)
    states = (modules, 6)
    vectors = (modules, 3)
    shapes = {
        "time": (),
        "actions": cables,
        "stage": (),
        "tick_time": (),
        "predicted": states,
        "sensed": vectors,
        "predictive_std": (modules,),
        "extrapolation": (),
        "outcome": (),
        "plan_error": (),
        "horizon": (PREVIEW, 3),
        "target_offsets": vectors,
        "payload": (),
        "bend_biases": (modules, 2),
        "external_force": (),
        "planned": vectors,
        "desired_positions": vectors,
        "desired_axes": vectors,
        **{SENSOR + name: shape for name, shape in sensor_shapes(arm).items()},
    }
    if "obstacles" in columns:
        # any number of obstacles, spheres alone or with cores
        count, numbers = (*columns["obstacles"].shape, 0, 0)[1:3]
        shapes["obstacles"] = (count, ROW if numbers == ROW else CORE.start)
    return shapes


def _read_only(name: str, values) -> np.ndarray:
    try:
        array = np.asarray(values)
    except ValueError:  # rows of different lengths
        array = np.array(values, dtype=object)
    if array.dtype.kind not in "fiub" or array.dtype.itemsize > 8 or array.ndim < 1:
        raise RecordingError(
            f"column '{name}' holds {array.dtype} of shape {array.shape}, "
            "not numbers for every step"
        )
    view = array.view()
    view.setflags(write=False)
    return view
