"""Figures that answer the paper's, for every table: of the first seed's runs."""

from collections.abc import Sequence
from pathlib import Path

import jax.numpy as jnp
import numpy as np

from s2c2a.data import Recording
from s2c2a.jobs import Run
from s2c2a.jobs.run_folder import trace_of
from s2c2a.kinematics import bends_from_configurations
from s2c2a.sensing import estimator_for
from s2c2a.studies.space_figures import obstacles_figure, plan_view_figure, poses_figure
from s2c2a.studies.time_figures import coordinates_figure, estimation_figure, interaction_figure, orientation_figure
from s2c2a.viz import Trace, recording_figure

Drawn = Sequence[tuple[str, list[Run]]]
"""What is special about some runs, and these."""


def simulation(drawn: Drawn, folder: Path) -> list[Path]:
    """Coordinates of every strategy, on the plain arm and on its variants."""
    every = [_named(run) for _, runs in drawn for run in _first(runs)]
    return [coordinates_figure(every, folder / "figure-sim2-coordinates.png")]


def tracking(drawn: Drawn, folder: Path) -> list[Path]:
    """The circle and the tilt tasks of the first runs."""
    circle = [trace_of(run) for run in _first(drawn[0][1]) if run.task == "circle"]
    ours = _by_task(drawn[0][1])
    views = {task: ours[task] for task in ("tilt-50", "tilt-50-a20", "tilt-50-c20")}
    return [
        coordinates_figure(circle, folder / "figure-06-coordinates.png"),
        orientation_figure([ours["tilt-50-a20"]], folder / "figure-08-orientation.png"),
        plan_view_figure(views, folder / "figure-10-plan-view.png"),
    ]


def constraint(drawn: Drawn, folder: Path) -> list[Path]:
    """Shapes of the arm while an end is held."""
    return [poses_figure(_by_task(drawn[0][1]), folder / "figure-11-poses.png")]


def interaction(drawn: Drawn, folder: Path) -> list[Path]:
    """An obstacle and a target that move."""
    both = _by_task(drawn[0][1])
    return [interaction_figure(both["flee"], both["follow"], folder / "figure-14-interaction.png")]


def obstacles(drawn: Drawn, folder: Path) -> list[Path]:
    """Ways past obstacles, with either guard."""
    overlaid: dict[str, list[Trace]] = {}
    for said, runs in drawn:
        for task, trace in _by_task(runs, said or "tip guarded").items():
            overlaid.setdefault(task, []).append(trace)
    reach = {task: traces for task, traces in overlaid.items() if task.startswith("reach")}
    risk = {task: traces for task, traces in overlaid.items() if task.startswith("risk")}
    return [
        obstacles_figure(reach, folder / "figure-12-obstacles.png"),
        obstacles_figure(risk, folder / "figure-13-risk.png"),
    ]


def workspace(recording: Recording, folder: Path) -> list[Path]:
    """Workspace of the staged data, and the middle module's bend as sensed and as it was, in one episode."""
    arm = recording.arm
    sensed, configurations = estimator_for(arm).sensed(recording.readings())[-1], recording.sensor("configurations")
    middle = arm.module_count // 2
    true, said = (_bend_angles_deg(values)[:, middle] for values in (configurations[-1], sensed))
    states = recording.sensor("states").reshape(-1, arm.module_count, 6)
    return [
        recording_figure(states, arm, folder / "figure-03-workspace.png"),
        estimation_figure(recording.time[-1], true, said, folder / "figure-04-estimation.png"),
    ]


def _bend_angles_deg(configurations: np.ndarray) -> np.ndarray:
    return np.rad2deg(np.linalg.norm(np.asarray(bends_from_configurations(jnp.asarray(configurations))), axis=-1))


def _first(runs: Sequence[Run]) -> list[Run]:
    return [run for run in runs if run.seed == runs[0].seed]


def _by_task(runs: Sequence[Run], label: str | None = None) -> dict[str, Trace]:
    """Ours, by task."""
    return {run.task: trace_of(run, label) for run in _first(runs) if run.strategy == "s2c2a"}


def _named(run: Run) -> Trace:
    variant = run.job.arm.name.removeprefix("simulated_arm").replace("_", " ").strip()
    return trace_of(run, f"{run.strategy}, {variant}" if variant else run.strategy)
