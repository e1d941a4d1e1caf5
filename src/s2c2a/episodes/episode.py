"""One container for what an arm did: collected, run, driven live, or imported."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmSpec
from s2c2a.errors import RecordingError
from s2c2a.spaces import Stage

SENSOR = "sensor."
MAX_COLUMNS = 256


@dataclass(frozen=True, eq=False)  # arrays inside know no single answer to ==
class Episode:
    """What an arm did; a row a control step, each with the reading before the step's action.

    What was not measured, asked or planned has no column. These columns mean the same
    in every episode:

    | column                            | what                                           | shape after the steps |
    | --------------------------------- | ---------------------------------------------- | --------------------- |
    | `time`                            | of the reading, since the arm was opened [s]   |                       |
    | `actions`                         | as really sent [m or N]                        | (modules, cables)     |
    | `sensor.NAME`                     | what a sensor said (`spaces.Reading`)          | its own               |
    | `stage`                           | number of the stage (`spaces.Stage`)           |                       |
    | `sensed`, `planned`               | configurations                                 | (modules, 3)          |
    | `expected`                        | states that the plan leads to [m, 1]           | (modules, 6)          |
    | `predictive_std`                       | how far off these must be expected to be [m]   | (modules,)            |
    | `extrapolation`                           | of that, because nothing was learned there [m] |                       |
    | `rescued`                         | what took over from the plan, zero if nothing  |                       |
    | `standing`                        | one where it stood though its cost could fall  |                       |
    | `load`                            | that is believed to hang at the tip [kg]       |                       |
    | `bend_biases`                           | by which modules are believed to lean [rad]    | (modules, 2)          |
    | `external_force`                            | force at the tip that leans stand for [N]      |                       |
    | `rejected.NAME`                   | one where a sense was not believed             |                       |
    | `desired_positions`, `desired_axes` | base frame [m, 1]; NaN where nothing was asked | (modules, 3)          |
    | `obstacles`                       | centers and thresholds [m]; 0: not there       | (obstacles, 4)        |
    | `tick_time`                       | sense, plan and act together [s]               |                       |

    Attributes:
        arm: that it was.
        columns: name -> numbers, all with as many steps.
        options: how it came about: task, strategy, seed, body, versions, ...; what JSON
            knows.

    Raises:
        RecordingError: columns of different lengths, no `time` or `actions`, times that
            do not rise, numbers that are not finite where they must be, or shapes that
            do not fit the arm.
    """

    arm: ArmSpec
    columns: Mapping[str, np.ndarray]
    options: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self):
        """Refuse what is no episode."""
        columns = {name: _frozen(name, values) for name, values in self.columns.items()}
        object.__setattr__(self, "columns", columns)
        if missing := {"time", "actions"} - set(columns):
            raise RecordingError(
                f"an episode needs {' and '.join(sorted(missing))}; it has {', '.join(columns)}"
            )
        if (
            len(columns) > MAX_COLUMNS
            or len({values.shape[:1] for values in columns.values()}) > 1
        ):
            raise RecordingError(
                f"an episode's columns must have as many steps each, at most {MAX_COLUMNS} of them"
            )
        for name, shape in _known_shapes(self.arm, columns).items():
            if name in columns and columns[name].shape[1:] != shape:
                raise RecordingError(
                    f"column '{name}' is of shape {columns[name].shape[1:]} a step; on '{self.arm.name}' it is {shape}"
                )
        for name in ("time", "actions"):
            if not np.isfinite(columns[name]).all():
                raise RecordingError(
                    f"column '{name}' holds numbers that are not finite"
                )
        if (np.diff(columns["time"]) <= 0).any():
            raise RecordingError("the times of an episode must rise from step to step")

    def __len__(self) -> int:
        """How many steps."""
        return len(self.columns["time"])

    def __getitem__(self, name: str) -> np.ndarray:
        """A column, first axis steps.

        Raises:
            RecordingError: there is none of that name.
        """
        if name not in self.columns:
            raise RecordingError(
                f"this episode has no '{name}'; it has {', '.join(self.columns)}"
            )
        return self.columns[name]

    def get(self, name: str) -> np.ndarray | None:
        """The same, None where there is none."""
        return self.columns.get(name)

    def sensor(self, name: str) -> np.ndarray:
        """What a sensor said before each action.

        Raises:
            RecordingError: it said nothing.
        """
        return self[SENSOR + name]

    @property
    def sensors(self) -> list[str]:
        """Names of the sensors, sorted."""
        return sorted(
            name.removeprefix(SENSOR)
            for name in self.columns
            if name.startswith(SENSOR)
        )

    @property
    def running(self) -> np.ndarray:
        """Numbers of the steps in which the arm was driven, or held in between; all where no stage is known."""
        stage = self.get("stage")
        return (
            np.arange(len(self))
            if stage is None
            else np.flatnonzero(np.isin(stage, (Stage.RUN, Stage.HOLD)))
        )

    def after(self, name: str) -> np.ndarray:
        """What a sensor said after each action of the run: what a goal is compared with.

        Raises:
            RecordingError: it said nothing, or the last action of the run has no
                reading after it.
        """
        values = self.sensor(name)
        steps = self.running + 1
        if len(steps) and steps[-1] >= len(values):
            raise RecordingError(
                "nothing was read after the last action of this episode; record one step more"
            )
        return values[steps]

    def ran(self, name: str) -> np.ndarray:
        """A column in the steps of the run."""
        return self[name][self.running]

    def times(self) -> Float[np.ndarray, " steps"]:
        """Of the readings after each action of the run [s]."""
        return self["time"][np.minimum(self.running + 1, len(self) - 1)]

    def with_options(self, **options: Any) -> "Episode":
        """The same with more said of how it came about."""
        return replace(self, options={**self.options, **options})


def stacked(episodes: Iterable[Episode], name: str) -> np.ndarray:
    """A column of episodes as one array, shape (episodes, steps, ...); shorter ones stay at their last row.

    Raises:
        RecordingError: one has no such column, or rows are of different shapes.
    """
    values = [episode[name] for episode in episodes]
    if len({one.shape[1:] for one in values}) != 1:
        raise RecordingError(
            f"'{name}' has shapes {sorted({one.shape for one in values})} in these episodes, not one"
        )
    longest = max(map(len, values))
    return np.stack(
        [
            np.concatenate([one, np.repeat(one[-1:], longest - len(one), axis=0)])
            for one in values
        ]
    )


def _known_shapes(
    arm: ArmSpec, columns: Mapping[str, np.ndarray]
) -> dict[str, tuple[int, ...]]:
    modules = arm.module_count
    cables = (arm.module_count, arm.cable_count)
    states = (modules, 6)
    vectors = (modules, 3)
    known = {
        "time": (),
        "actions": cables,
        "stage": (),
        "tick_time": (),
        "predicted": states,
        "sensed": vectors,
    }
    known |= {
        "predictive_std": (modules,),
        "extrapolation": (),
        "rescued": (),
        "standing": (),
        "load": (),
        "bend_biases": (modules, 2),
        "push": (),
    }
    known |= {"planned": vectors, "desired_positions": vectors, "desired_axes": vectors}
    if "obstacles" in columns:
        # as many as there are
        known["obstacles"] = (*columns["obstacles"].shape[1:2], 4)
    return known | {
        SENSOR + "cables": cables,
        SENSOR + "states": states,
        SENSOR + "configurations": vectors,
    }


def _frozen(name: str, values) -> np.ndarray:
    try:
        array = np.asarray(values)
    except ValueError:  # rows of different lengths
        array = np.array(values, dtype=object)
    if array.dtype.kind not in "fiub" or array.dtype.itemsize > 8 or array.ndim < 1:
        raise RecordingError(
            f"column '{name}' holds {array.dtype} of shape {array.shape}, not numbers for every step"
        )
    view = array.view()
    view.setflags(write=False)
    return view
