"""The same window for what is finished: runs to scrub and compare, recordings, trainings, an arm to bend."""

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np
import viser
from jaxtyping import Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.episodes import Episode
from s2c2a.kinematics import PCC
from s2c2a.live.plots import add_chart, unit_of_cables
from s2c2a.live.snapshot import straight
from s2c2a.live.window import Window, sound_value
from s2c2a.live.workspace import arcs, bends_of, workspace
from s2c2a.spaces import POSITION, States
from s2c2a.strategies import TrainedNetworks
from s2c2a.viz import Trace
from s2c2a.viz.reconstruction import completed

MAX_POINTS = 1500  # of a recording's cloud, a module
CURVES = {"training": "#1f5fc4", "validation": "#c77d0a"}


def view_arm(arm: ArmSpec, port: int) -> Window:
    """An arm on its own: a slider for every module's bend and its direction, the arm as arcs, cables in numbers."""
    window = Window(arm)
    pcc = PCC.of(arm)
    gui = window.server.gui
    said = gui.add_markdown("", order=100)
    sizes = []
    turns = []
    for number, limit in enumerate(np.rad2deg(ArmGeometry.of(arm).bend_limits)):
        sizes.append(
            gui.add_slider(
                f"Bend {number + 1} [deg]", 0.0, round(float(limit), 1), 0.5, 0.0
            )
        )
        turns.append(
            gui.add_slider(f"Towards {number + 1} [deg]", -180.0, 180.0, 5.0, 0.0)
        )

    def draw() -> None:
        bends = bends_of(
            *(
                np.deg2rad([sound_value(slider) for slider in sliders])
                for sliders in (sizes, turns)
            )
        )
        states = arcs(arm, bends)
        window.scene.draw_arm(states)
        said.content = _cables_said(
            arm, np.asarray(pcc.actions(jnp.asarray(bends, jnp.float32))), states
        )

    for slider in (*sizes, *turns):
        slider.on_update(lambda _event: draw())
    draw()
    window.scene.draw_cloud(workspace(arm))
    return window.open(port)


def view_training(networks: TrainedNetworks, port: int) -> Window:
    """A training run: how both networks came about, as curves, beside the arm that they were trained for."""
    arm = networks.arm
    window = Window(arm)
    gui = window.server.gui
    gui.add_markdown(
        f"**{arm.name}** · recipe {networks.recipe.name} · seed {networks.seed}"
    )
    for name, rows in networks.curves.items():
        mean, spread = networks.percent[name]
        gui.add_markdown(
            f"{name}: {len(rows)} epochs, held out {mean:.2f} ± {spread:.2f} % of the full range"
        )
        logarithms = np.log10(np.maximum(rows[:, 1:], 1e-12))
        add_chart(
            gui,
            f"{name}: loss, logarithm",
            CURVES,
            (rows[:, 0], *logarithms.T),
            label="epoch",
        )
    window.scene.draw_cloud(workspace(arm))
    return window.open(port)


def view_recording(episodes: Sequence[Episode], port: int) -> Window:
    """A recording: every module's end of all samples as a cloud (the paper's figure 3), and its episodes to scrub.

    Raises:
        S2C2AError: an episode without true states.
    """
    arm = episodes[0].arm
    traces = [
        Trace(episode, f"episode {number + 1}")
        for number, episode in enumerate(episodes)
    ]
    # (samples, modules, 3)
    ends = np.concatenate([trace.states[..., POSITION] for trace in traces])
    window = Window(arm)
    _scrub(window, traces, "Show", ghosts=False)
    window.scene.draw_cloud([_some_known(module) for module in np.moveaxis(ends, 1, 0)])
    return window.open(port)


def _some_known(
    points: Float[np.ndarray, "samples 3"],
) -> Float[np.ndarray, "points 3"]:
    """Of those that were seen, so many that they can be drawn."""
    known = points[np.isfinite(points).all(axis=1)]
    return known[
        np.linspace(0, len(known) - 1, min(len(known), MAX_POINTS)).astype(int)
    ]


def view_runs(traces: Sequence[Trace], arm: ArmSpec, port: int) -> Window:
    """Runs to scrub: the chosen one as the arm, another one as its ghost."""
    window = Window(arm)
    _scrub(window, traces, "Run", ghosts=True)
    return window.open(port)


def _scrub(window: Window, traces: Sequence[Trace], label: str, ghosts: bool) -> None:
    """What is shown, a slider of time, a button that plays, and the scene at that time."""
    gui = window.server.gui
    names = {
        f"{number + 1} · {trace.label}": trace for number, trace in enumerate(traces)
    }
    shown = gui.add_dropdown(label, tuple(names))
    beside = gui.add_dropdown(
        "Ghost",
        ("none", *names),
        initial_value=[*names, "none"][len(names) > 1],
        visible=ghosts,
    )
    moment = gui.add_slider("Time [s]", 0.0, _length(traces[0]), 0.05, 0.0)
    play = gui.add_button("Pause", color="blue")
    said = gui.add_markdown("")

    @play.on_click
    async def _(_event: viser.GuiEvent) -> None:
        play.label = "Play" if play.label == "Pause" else "Pause"

    def draw(passed: float) -> None:
        trace = names[sound_value(shown)]
        now = sound_value(moment)
        moment.max = end = _length(trace)
        # it begins when somebody comes
        if play.label == "Pause" and window.server.get_clients():
            now = 0.0 if now >= end else min(now + passed, end)
            moment.value = now  # type: ignore[misc] # viser hides the setter from type checkers
        said.content = _draw_moment(
            window, trace, names.get(sound_value(beside)) if ghosts else None, now
        )

    window.every(draw)


def _length(trace: Trace) -> float:
    """Of a run [s]."""
    return max(float(trace.times[-1] - trace.times[0]), 0.1)


def _draw_moment(
    window: Window, trace: Trace, other: Trace | None, moment: float
) -> str:
    """One run as the arm, another one as its ghost; says how far the first is from its target."""
    step = _step_at(trace, moment)
    scene = window.scene
    states = drawable(trace.states[: step + 1], trace.episode.arm)
    scene.draw_arm(states)
    scene.draw_ghost(
        None
        if other is None
        else drawable(other.states[: _step_at(other, moment) + 1], other.episode.arm),
        states,
    )
    scene.draw_target(
        trace.desired_path[step], trace.desired_axes[step, trace.pointing_module]
    )
    scene.draw_obstacles((), trace.spheres(step), states[-1, POSITION])
    scene.draw_trail("real", trace.followed_path[: step + 1])
    scene.draw_trail("desired", trace.desired_path)
    error = trace.position_errors[step]
    return f"**{trace.label}**" + (
        f" · {100 * error:.2f} cm from the target" if np.isfinite(error) else ""
    )


def drawable(states: Float[np.ndarray, "steps modules 6"], arm: ArmSpec) -> States:
    """The last of them of which an end was seen, what was not seen of it completed; straight where none was."""
    seen = np.flatnonzero(np.isfinite(states[..., POSITION]).all(axis=-1).any(axis=-1))
    return (
        completed(states[seen[-1]], ArmGeometry.of(arm).lengths)
        if len(seen)
        else straight(arm)
    )


def _step_at(trace: Trace, moment: float) -> int:
    return (
        int(
            np.searchsorted(trace.times - trace.times[0], moment, side="right").clip(
                1, trace.times.size
            )
        )
        - 1
    )


def _cables_said(arm: ArmSpec, actions: np.ndarray, states: States) -> str:
    """A table of the cables, under the tip's place."""
    unit, scale = unit_of_cables(arm)
    tip = ", ".join(f"{100 * value:.1f}" for value in states[-1, POSITION])
    rows = [
        [f"module, then cables [{unit}]", *range(1, arm.cable_count + 1)],
        ["---"] * (arm.cable_count + 1),
    ]
    rows += [
        [number + 1, *(f"{scale * value:.1f}" for value in cables)]
        for number, cables in enumerate(actions)
    ]
    return f"tip at {tip} cm\n\n" + "\n".join(
        f"| {' | '.join(map(str, row))} |" for row in rows
    )
