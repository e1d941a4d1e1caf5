"""Figures that answer the paper's, for every table: of the first seed's runs."""

from collections.abc import Sequence
from pathlib import Path

import jax.numpy as jnp
import numpy as np

from s2c2a.arm import ArmSpec, load_arm
from s2c2a.data import CollectOptions
from s2c2a.experiments.following import Run
from s2c2a.experiments.run_folder import trace_of
from s2c2a.experiments.workshop import Workshop
from s2c2a.kinematics import bends_from_configurations
from s2c2a.sensing import estimator_for
from s2c2a.strategies import Recipe
from s2c2a.viz import (
    Trace,
    coordinates_figure,
    estimation_figure,
    interaction_figure,
    obstacles_figure,
    orientation_figure,
    plan_view_figure,
    poses_figure,
    recording_figure,
)

Drawn = Sequence[tuple[str, ArmSpec, list[Run]]]
"""What is special about the runs, their arm, the runs."""


def draw_table(
    name: str, parts: Drawn, folder: Path, workshop: Workshop, recipe: Recipe, seeds: Sequence[int]
) -> list[Path]:
    """Draw what belongs to a table; returns the files."""
    folder.mkdir(parents=True, exist_ok=True)
    if name == "simulation":
        every = [_named(run, arm) for _, arm, runs in parts for run in _first(runs)]
        return [coordinates_figure(every, folder / "figure-sim2-coordinates.png")]
    if name == "tracking":
        return _tracking(parts, folder)
    if name == "constraint":
        return [poses_figure(_by_task(parts[0][2]), folder / "figure-11-poses.png")]
    if name == "obstacles":
        return _obstacles(parts, folder)
    if name == "interaction":
        both = _by_task(parts[0][2])
        return [interaction_figure(both["flee"], both["follow"], folder / "figure-14-interaction.png")]
    if name == "workspace":
        return _recorded(folder, workshop, recipe, seeds[0])
    return []


def _tracking(parts: Drawn, folder: Path) -> list[Path]:
    runs = _first(parts[0][2])
    circle = [trace_of(run) for run in runs if run.task == "circle"]
    ours = _by_task(parts[0][2])
    views = {task: ours[task] for task in ("tilt-50", "tilt-50-a20", "tilt-50-c20")}
    return [
        coordinates_figure(circle, folder / "figure-06-coordinates.png"),
        orientation_figure([ours["tilt-50-a20"]], folder / "figure-08-orientation.png"),
        plan_view_figure(views, folder / "figure-10-plan-view.png"),
    ]


def _obstacles(parts: Drawn, folder: Path) -> list[Path]:
    overlaid: dict[str, list[Trace]] = {}
    for said, _, runs in parts:
        for task, trace in _by_task(runs, said or "tip guarded").items():
            overlaid.setdefault(task, []).append(trace)
    reach = {task: traces for task, traces in overlaid.items() if task.startswith("reach")}
    risk = {task: traces for task, traces in overlaid.items() if task.startswith("risk")}
    return [
        obstacles_figure(reach, folder / "figure-12-obstacles.png"),
        obstacles_figure(risk, folder / "figure-13-risk.png"),
    ]


def _recorded(folder: Path, workshop: Workshop, recipe: Recipe, seed: int) -> list[Path]:
    """Workspace of the staged data, and the middle module's bend as sensed and as it was, in one episode."""
    arm = load_arm("twin_arm")
    recording = workshop.recording(arm, CollectOptions(seed=seed, speeds=recipe.speeds))
    sensed = np.asarray(estimator_for(arm)(recording.cables[-1], recording.configurations[-1]))
    middle = arm.module_count // 2
    true, said = (_bend_angles_deg(values)[:, middle] for values in (recording.configurations[-1], sensed))
    states = recording.states.reshape(-1, arm.module_count, 6)
    return [
        recording_figure(states, folder / "figure-03-workspace.png"),
        estimation_figure(recording.time[-1], true, said, folder / "figure-04-estimation.png"),
    ]


def _bend_angles_deg(configurations: np.ndarray) -> np.ndarray:
    return np.rad2deg(np.linalg.norm(np.asarray(bends_from_configurations(jnp.asarray(configurations))), axis=-1))


def _first(runs: Sequence[Run]) -> list[Run]:
    return [run for run in runs if run.seed == runs[0].seed]


def _by_task(runs: Sequence[Run], label: str | None = None) -> dict[str, Trace]:
    """Ours, by task."""
    return {run.task: trace_of(run, label) for run in _first(runs) if run.controller == "s2c2a"}


def _named(run: Run, arm: ArmSpec) -> Trace:
    variant = arm.name.removeprefix("simulated_arm").replace("_", " ").strip()
    return trace_of(run, f"{run.controller}, {variant}" if variant else run.controller)
