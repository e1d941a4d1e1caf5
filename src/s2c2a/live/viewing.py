"""Viewer of runs, recordings, trainings and arms, in the window of the live page."""

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np
import viser
from jaxtyping import Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.episodes import Episode
from s2c2a.errors import ReadingError, counted
from s2c2a.estimation import MODAL_MODEL
from s2c2a.evaluation import describe_held_out_errors, describe_modal_model
from s2c2a.kinematics import PCC
from s2c2a.live.plots import add_chart, unit_of_cables
from s2c2a.live.reconstruction import completed
from s2c2a.live.snapshot import straight
from s2c2a.live.window import Window, checked_value
from s2c2a.live.workspace import arcs, bends_of, workspace
from s2c2a.spaces import POSITION, States
from s2c2a.strategies import TrainedNetworks
from s2c2a.training.fit import is_fixed
from s2c2a.viz import Trace
from s2c2a.viz.colors import PALETTE
from s2c2a.viz.coverage import coverage_image

MAX_POINTS = 1500  # of each module in a recording's cloud
CURVES = {"training": PALETTE[0], "validation": PALETTE[2]}
NO_GHOST = "none"


def view_arm(arm: ArmSpec, port: int) -> Window:
    """Show an arm that sliders bend, with its modules as arcs, and its cables."""
    window = Window(arm)
    pcc = PCC.of(arm)
    gui = window.server.gui
    text = gui.add_markdown("", order=100)
    angles = []
    directions = []
    limits = np.rad2deg(ArmGeometry.of(arm).bend_limits)
    for module, limit in enumerate(limits, 1):
        angle = gui.add_slider(
            f"Bend {module} [deg]", 0.0, round(float(limit), 1), 0.5, 0.0
        )
        direction = gui.add_slider(f"Direction {module} [deg]", -180.0, 180.0, 5.0, 0.0)
        angles.append(angle)
        directions.append(direction)

    def draw() -> None:
        bends = bends_of(_radians(angles), _radians(directions))
        states = arcs(arm, bends)
        window.scene.draw_arm(states)
        actions = np.asarray(pcc.actions(jnp.asarray(bends, jnp.float32)))
        text.content = _cable_table(arm, actions, states)

    for slider in (*angles, *directions):
        slider.on_update(lambda _event: draw())
    draw()
    window.scene.draw_cloud(workspace(arm))
    return window.open(port)


def _radians(sliders: Sequence[viser.GuiSliderHandle]) -> np.ndarray:
    return np.deg2rad([checked_value(slider) for slider in sliders])


def view_training(networks: TrainedNetworks, port: int) -> Window:
    """Show the loss curves of a training, beside its arm."""
    arm = networks.arm
    window = Window(arm)
    gui = window.server.gui
    gui.add_markdown(
        f"**{arm.name}** · recipe {networks.recipe.name} · seed {networks.seed}"
    )
    for line in describe_held_out_errors(networks):
        gui.add_markdown(line)
    for name, result in networks.trained.items():
        rows = result.curve
        gui.add_markdown(_training_text(networks, name))
        logarithms = np.log10(np.maximum(rows[:, 1:], 1e-12))
        values = (rows[:, 0], *logarithms.T)
        add_chart(gui, f"{name}: log10 of the loss", CURVES, values, label="epoch")
    window.scene.draw_cloud(workspace(arm))
    return window.open(port)


def _training_text(networks: TrainedNetworks, name: str) -> str:
    """Length of a training and its error, of the modal model in its own words."""
    if name == MODAL_MODEL:
        return describe_modal_model(networks)
    if is_fixed(networks.trained[name].network):
        return f"{name}: fitted, without held-out data"
    mean, std = networks.trained[name].percent
    return (
        f"{name}: {counted(len(networks.trained[name].curve), 'epoch')}; error on "
        f"held-out data {mean:.2f} ± {std:.2f} % of the full range"
    )


def view_recording(episodes: Sequence[Episode], port: int) -> Window:
    """Show the episodes of a recording, and all ends of modules as a point cloud.

    The cloud is the paper's figure 3.

    Raises:
        S2C2AError: an episode has no true states.
    """
    arm = episodes[0].arm
    traces = [
        Trace(episode, f"episode {number}")
        for number, episode in enumerate(episodes, 1)
    ]
    ends = np.concatenate([trace.states[..., POSITION] for trace in traces])
    # (samples, modules, 3)
    window = Window(arm)
    _add_player(window, traces, "Episode", ghosts=False)
    _add_coverage(window, episodes)
    window.scene.draw_cloud([_thinned(points) for points in np.moveaxis(ends, 1, 0)])
    return window.open(port)


def _add_coverage(window: Window, episodes: Sequence[Episode]) -> None:
    """Add the figure of configurations and speeds, if they were recorded."""
    try:
        pixels = coverage_image(episodes)
    except ReadingError:  # such as true configurations without tracking
        return
    with window.server.gui.add_folder("Coverage", order=20):
        window.server.gui.add_image(pixels, format="png")


def _thinned(points: Float[np.ndarray, "samples 3"]) -> Float[np.ndarray, "points 3"]:
    """At most `MAX_POINTS` of the finite points."""
    finite = points[np.isfinite(points).all(axis=1)]
    count = min(len(finite), MAX_POINTS)
    return finite[np.linspace(0, len(finite) - 1, count).astype(int)]


def view_runs(traces: Sequence[Trace], arm: ArmSpec, port: int) -> Window:
    """Show runs: one as the arm, another as its ghost."""
    window = Window(arm)
    _add_player(window, traces, "Run", ghosts=True)
    return window.open(port)


def _add_player(
    window: Window, traces: Sequence[Trace], label: str, ghosts: bool
) -> None:
    """Add the choice of a run and of a ghost, a time slider and a play button."""
    gui = window.server.gui
    names = {
        f"{number} · {trace.label}": trace for number, trace in enumerate(traces, 1)
    }
    run = gui.add_dropdown(label, tuple(names))
    ghost = gui.add_dropdown(
        "Ghost",
        (NO_GHOST, *names),
        initial_value=[*names, NO_GHOST][len(names) > 1],
        visible=ghosts,
    )
    time = gui.add_slider("Time [s]", 0.0, _duration(traces[0]), 0.05, 0.0)
    play = gui.add_button("Pause", color="blue")
    text = gui.add_markdown("")

    @play.on_click
    async def _(_event: viser.GuiEvent) -> None:
        play.label = "Play" if play.label == "Pause" else "Pause"

    def draw(elapsed: float) -> None:
        trace = names[checked_value(run)]
        now = checked_value(time)
        end = _duration(trace)
        time.max = end
        # play only while a browser is connected
        if play.label == "Pause" and window.server.get_clients():
            now = 0.0 if now >= end else min(now + elapsed, end)
            time.value = now  # type: ignore[misc] # viser hides the setter
        other = names.get(checked_value(ghost)) if ghosts else None
        text.content = _draw_moment(window, trace, other, now)

    window.every(draw)


def _duration(trace: Trace) -> float:
    """Duration of a run [s]."""
    return max(float(trace.times[-1] - trace.times[0]), 0.1)


def _draw_moment(window: Window, trace: Trace, other: Trace | None, time: float) -> str:
    """Draw a run as the arm and another as its ghost; returns the run's error."""
    step = _step_at(trace, time)
    scene = window.scene
    states = drawable(trace.states[: step + 1], trace.episode.arm)
    scene.draw_arm(states)
    ghost = None
    if other is not None:
        ghost_steps = _step_at(other, time) + 1
        ghost = drawable(other.states[:ghost_steps], other.episode.arm)
    scene.draw_ghost(ghost, states)
    scene.draw_uncertainty(trace.predicted_path[step], trace.predictive_std[step])
    axis = trace.desired_axes[step, trace.pointing_module]
    scene.draw_target(trace.desired_path[step], axis)
    scene.draw_obstacles((), trace.standing(step), states[-1, POSITION])
    scene.draw_trail("real", trace.followed_path[: step + 1])
    scene.draw_trail("desired", trace.desired_path)
    error = trace.position_errors[step]
    if not np.isfinite(error):
        return f"**{trace.label}**"
    text = f"**{trace.label}** · {100 * error:.2f} cm from the target"
    plan = trace.plan_texts[step]
    return f"{text} · {plan}" if plan else text


def drawable(states: Float[np.ndarray, "steps modules 6"], arm: ArmSpec) -> States:
    """The last states with a measured end, completed; straight without any."""
    finite = np.isfinite(states[..., POSITION]).all(axis=-1)
    measured = np.flatnonzero(finite.any(axis=-1))
    if not len(measured):
        return straight(arm)
    return completed(states[measured[-1]], ArmGeometry.of(arm).lengths)


def _step_at(trace: Trace, time: float) -> int:
    """The last step that began at or before a time [s]."""
    count = np.searchsorted(trace.times - trace.times[0], time, side="right")
    return int(count.clip(1, trace.times.size)) - 1


def _cable_table(arm: ArmSpec, actions: np.ndarray, states: States) -> str:
    """Markdown of the tip's position and a table of the cables."""
    unit, scale = unit_of_cables(arm)
    centimeters = 100 * states[-1, POSITION]
    tip = ", ".join(f"{value:.1f}" for value in centimeters)
    rows = [
        [f"module, then cables [{unit}]", *range(1, arm.cable_count + 1)],
        ["---"] * (arm.cable_count + 1),
    ]
    for module, cables in enumerate(actions, 1):
        rows.append([module, *(f"{scale * value:.1f}" for value in cables)])
    table = "\n".join(f"| {' | '.join(map(str, row))} |" for row in rows)
    return f"tip at {tip} cm\n\n{table}"
