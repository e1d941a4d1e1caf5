"""The same scene for what is finished: runs to scrub and compare, recordings, an arm to bend."""

import threading
from collections.abc import Callable, Sequence

import jax.numpy as jnp
import numpy as np
import viser
from jaxtyping import Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.data import Recording
from s2c2a.kinematics import PCC, states_from_bends
from s2c2a.live.beats import beats
from s2c2a.live.gate import Gate
from s2c2a.live.page import look_at_arm, open_viser
from s2c2a.live.plots import add_chart
from s2c2a.live.scene import ArmScene
from s2c2a.live.wish import MOST_OBSTACLES, Obstacle, Point
from s2c2a.live.workspace import workspace
from s2c2a.spaces import POSITION, States
from s2c2a.strategies import TrainedNetworks
from s2c2a.viz import Trace

MOST_POINTS = 1500  # of a recording's cloud, a module
FRAME = 1 / 30  # s
CURVES = {"training": "#1f5fc4", "validation": "#c77d0a"}


class ViewPage:
    """A page without a loop: everybody who looks may turn its knobs.

    Attributes:
        gate: where browsers come in.
    """

    def __init__(self, arm: ArmSpec, states: States, port: int):
        """The arm in some states.

        Raises:
            S2C2AError: no port is free.
        """
        self._server, secret = open_viser(f"s2c2a · {arm.name}")
        look_at_arm(self._server, arm.length)
        self.arm, self.gui = arm, self._server.gui
        self.scene = ArmScene(self._server.scene, arm)
        self.scene.draw_arm(states)
        self._closing = threading.Event()
        self.gate = Gate(port, self._server.get_port(), secret)

    def on_first(self, act: Callable[[], None]) -> None:
        """Act once, when the first browser comes."""
        come: list[int] = []

        @self._server.on_client_connect
        async def _(client: viser.ClientHandle) -> None:
            come.append(client.client_id)
            if len(come) == 1:
                act()

    def every(self, period: float, act: Callable[[float], None]) -> None:
        """Act until the page closes, in a thread of its own; told how long the last time was ago [s]."""

        def again() -> None:
            for passed in beats(period, self._closing):
                act(passed)

        threading.Thread(target=again, daemon=True).start()

    def close(self) -> None:
        """Close the gate and the page."""
        self._closing.set()
        self.gate.close()
        self._server.stop()


def view_arm(arm: ArmSpec, port: int) -> ViewPage:
    """An arm on its own: a slider for every module's bend and its direction, the arm as arcs, cables in numbers."""
    page = ViewPage(arm, _arcs(arm, np.zeros((arm.module_count, 2))), port)
    geometry, pcc = ArmGeometry.of(arm), PCC.of(arm)
    said = page.gui.add_markdown("", order=100)
    sizes, turns = [], []
    for number, limit in enumerate(np.rad2deg(geometry.bend_limits)):
        sizes.append(page.gui.add_slider(f"Bend {number + 1} [deg]", 0.0, round(float(limit), 1), 0.5, 0.0))
        turns.append(page.gui.add_slider(f"Towards {number + 1} [deg]", -180.0, 180.0, 5.0, 0.0))

    def draw() -> None:
        angles = np.deg2rad([slider.value for slider in turns])
        bends = np.deg2rad([[slider.value] for slider in sizes]) * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        states = _arcs(arm, bends)
        page.scene.draw_arm(states)
        said.content = _cables_said(arm, np.asarray(pcc.actions(bends.astype(np.float32))), states)

    for slider in (*sizes, *turns):
        slider.on_update(lambda _event: draw())
    draw()
    page.scene.draw_cloud(workspace(arm))
    return page


def view_training(networks: TrainedNetworks, port: int) -> ViewPage:
    """A training run: how both networks came about, as curves, beside the arm that they were trained for."""
    arm = networks.arm
    page = ViewPage(arm, _arcs(arm, np.zeros((arm.module_count, 2))), port)
    page.gui.add_markdown(f"**{arm.name}** · recipe {networks.recipe.name} · seed {networks.seed}")
    for name, rows in networks.curves.items():
        mean, spread = networks.percent[name]
        page.gui.add_markdown(f"{name}: {len(rows)} epochs, held out {mean:.2f} ± {spread:.2f} % of the full range")
        add_chart(page.gui, f"{name}: loss, logarithm", CURVES, tuple(_logarithms(rows)), label="epoch")
    page.scene.draw_cloud(workspace(arm))
    return page


def _logarithms(rows: Float[np.ndarray, "epochs 3"]) -> Float[np.ndarray, "3 epochs"]:
    """Epochs, and the logarithms of training and validation loss."""
    return np.stack([rows[:, 0], *np.log10(np.maximum(rows[:, 1:], 1e-12)).T])


def view_recording(recording: Recording, port: int) -> ViewPage:
    """A recording: every module's end of all samples as a cloud (the paper's figure 3), and its episodes to scrub."""
    states = recording.states
    page = ViewPage(recording.arm, np.nan_to_num(states[0, 0]), port)
    ends = states[..., POSITION].reshape(-1, recording.arm.module_count, 3)
    ends = ends[np.isfinite(ends).all(axis=(1, 2))]
    kept = np.linspace(0, len(ends) - 1, min(len(ends), MOST_POINTS)).astype(int)
    page.scene.draw_cloud(np.swapaxes(ends[kept], 0, 1))
    names = tuple(f"episode {number + 1}" for number in range(len(states)))
    chosen = page.gui.add_dropdown("Show", names)
    _scrub(page, lambda: [Trace.without_target("", recording.time[k := names.index(chosen.value)], states[k])])
    return page


def view_runs(traces: Sequence[Trace], arm: ArmSpec, port: int) -> ViewPage:
    """Runs to scrub: the chosen one as the arm, another one as its ghost."""
    page = ViewPage(arm, np.nan_to_num(traces[0].states[0]), port)
    names = tuple(f"{number + 1} · {trace.label}" for number, trace in enumerate(traces))
    shown = page.gui.add_dropdown("Run", names)
    beside = page.gui.add_dropdown("Ghost", ("none", *names), initial_value=names[1] if len(names) > 1 else "none")

    def chosen() -> list[Trace]:
        ghost = [] if beside.value == "none" else [traces[names.index(beside.value)]]
        return [traces[names.index(shown.value)], *ghost]

    _scrub(page, chosen)
    return page


def _scrub(page: ViewPage, chosen) -> None:
    """A slider of time, a button that plays, and the scene at that time."""
    last = float(chosen()[0].times[-1] - chosen()[0].times[0])
    moment = page.gui.add_slider("Time [s]", 0.0, max(last, 0.1), 0.05, 0.0)
    play = page.gui.add_button("Pause", color="blue")
    said = page.gui.add_markdown("")
    playing = [True]

    @page.on_first
    def _() -> None:
        moment.value = 0.0  # type: ignore[misc]

    @play.on_click
    async def _(_event: viser.GuiEvent) -> None:
        playing[0] = not playing[0]
        play.label = "Pause" if playing[0] else "Play"

    def draw(passed: float) -> None:
        if playing[0]:
            end = moment.max
            moment.value = 0.0 if moment.value >= end else min(moment.value + passed, end)  # type: ignore[misc]
        said.content = _draw_moment(page, chosen(), float(moment.value))

    page.every(FRAME, draw)


def _draw_moment(page: ViewPage, traces: list[Trace], moment: float) -> str:
    """The first run as the arm, the second as its ghost; says how far the first is from its target."""
    trace, scene = traces[0], page.scene
    step = _step_at(trace, moment)
    states = np.nan_to_num(trace.states[step])
    scene.draw_arm(states)
    other = traces[1].states[_step_at(traces[1], moment)] if len(traces) > 1 else None
    scene.draw_ghost(None if other is None else np.nan_to_num(other), states)
    scene.draw_target(_point(trace.wanted_path[step]), _point(trace.wanted_axes[step, trace.pointing_module]), 0.0)
    spheres = [Obstacle(_sure(row[:3]), float(row[3])) for row in trace.obstacles[step] if row[3] > 0]
    scene.draw_obstacles((), spheres[:MOST_OBSTACLES], states[-1, POSITION])
    scene.draw_trail("real", trace.followed_path[: step + 1])
    scene.draw_trail("wanted", trace.wanted_path)
    error = trace.position_errors[step]
    return f"**{trace.label}**" + (f" · {100 * error:.2f} cm from the target" if np.isfinite(error) else "")


def _step_at(trace: Trace, moment: float) -> int:
    return int(np.searchsorted(trace.times - trace.times[0], moment, side="right").clip(1, trace.times.size)) - 1


def _point(values: np.ndarray) -> Point | None:
    return _sure(values) if np.isfinite(values).all() else None


def _sure(values: np.ndarray) -> Point:
    x, y, z = (float(value) for value in values)
    return x, y, z


def _arcs(arm: ArmSpec, bends: np.ndarray) -> States:
    lengths = jnp.asarray(ArmGeometry.of(arm).lengths, jnp.float32)
    return np.asarray(states_from_bends(jnp.asarray(bends, jnp.float32), lengths), dtype=float)


def _cables_said(arm: ArmSpec, actions: np.ndarray, states: States) -> str:
    unit, scale = ("mm", 1e3) if arm.actuation == "displacement" else ("N", 1.0)
    rows = [
        f"| {number + 1} | " + " | ".join(f"{scale * value:.1f}" for value in cables) + " |"
        for number, cables in enumerate(actions)
    ]
    head = (
        f"| module, then cables [{unit}] | " + " | ".join(str(number + 1) for number in range(arm.cable_count)) + " |"
    )
    tip = ", ".join(f"{100 * value:.1f}" for value in states[-1, POSITION])
    return "\n".join([f"tip at {tip} cm\n", head, "|---" * (arm.cable_count + 1) + "|", *rows])
