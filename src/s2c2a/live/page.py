"""The page: viser behind the gate, the scene drawn at its own rate, and a panel for everyone who comes."""

import io
import threading
import time
import warnings
from collections import deque
from collections.abc import Callable
from contextlib import redirect_stdout
from pathlib import Path
from typing import NamedTuple

import numpy as np
import viser
from jaxtyping import Float

from s2c2a.live.beats import beats
from s2c2a.live.gate import HOST, Gate, new_secret, only_with
from s2c2a.live.panel import Desk, Panel, View
from s2c2a.live.plots import Plots
from s2c2a.live.recorder import Recorder
from s2c2a.live.scene import ArmScene
from s2c2a.live.session import Session
from s2c2a.live.snapshot import Control, Snapshot, Stage
from s2c2a.live.wish import Obstacle, Point
from s2c2a.spaces import AXIS, POSITION, States

FRAME = 1 / 30  # s between frames
TRAIL = 15.0  # s
PLOT_EVERY = 8  # frames
PREPARING = "preparing the arm: the first start on a machine compiles, which takes up to half a minute"
BRAND = (31, 95, 196)
CAMERA, LOOK_AT = (1.75, -1.85, 1.2), (0.12, 0.1, 0.55)  # in parts of the arm's length
UPRIGHT_CAMERA, UPRIGHT_LOOK_AT = (2.7, -2.9, 1.5), (0.0, 0.0, 0.1)  # of a telephone, its lower half under the panel


warnings.filterwarnings("ignore", message="Queued a .* on a closed connection")  # of browsers that have just gone


def open_viser(title: str) -> tuple[viser.ViserServer, str]:
    """A viser server on 127.0.0.1 that takes websockets from its gate alone, and the secret that the gate says."""
    secret = new_secret()
    with only_with(secret), redirect_stdout(io.StringIO()):
        server = viser.ViserServer(host=HOST, port=0, label=title, verbose=False)
    server.gui.configure_theme(show_logo=False, show_share_button=False, brand_color=BRAND, control_width="medium")
    return server, secret


def look_at_arm(server: viser.ViserServer, size: float) -> None:
    """Put the camera where the whole arm and its workspace are seen."""
    server.initial_camera.position = size * np.array(CAMERA)
    server.initial_camera.look_at = size * np.array(LOOK_AT)
    server.initial_camera.fov = np.deg2rad(40)


def across_the_screen() -> Float[np.ndarray, "3"]:
    """The direction to the right on the screen, seen from where the camera is first, base frame."""
    across = np.cross(np.subtract(LOOK_AT, CAMERA), (0.0, 0.0, 1.0))
    return across / np.linalg.norm(across)


class Survey(NamedTuple):
    """Where an arm can be.

    Attributes:
        cloud: ends of the modules [m], shape (modules, points, 3).
        gap: how far out of the tip's reach a point is [m].
    """

    cloud: Float[np.ndarray, "modules points 3"]
    gap: Callable[[Point], float]


class LivePage:
    """The live page of one control loop.

    Attributes:
        gate: where browsers come in.
        session: who drives.
        frames: drawn so far.
    """

    def __init__(
        self,
        loop: Control,
        port: int,
        runs: Path,
        survey: Callable[[], Survey] | None = None,
    ):
        """Open the page of a loop that runs, or will soon: until its first snapshot the page says that it prepares.

        Args:
            loop: moves the arm.
            port: where the page shall be; the next free one if it is taken.
            runs: where recordings go.
            survey: finds out where the arm can be; called once the arm is there, in a thread of its own.

        Raises:
            S2C2AError: no port is free.
        """
        self._loop, self._arm = loop, loop.arm
        self._server, secret = open_viser(f"s2c2a · {loop.arm.name}")
        look_at_arm(self._server, loop.arm.length)
        self.session = Session(self._session_changed)
        self._panels: dict[int, Panel] = {}
        self._view = View()
        self._desk = Desk(loop, self.session, Recorder(loop, runs), self._view, across_the_screen(), self._tell)
        self._status = self._server.gui.add_markdown(f"**{loop.arm.name}** · {PREPARING}", order=0)
        self._scene = ArmScene(self._server.scene, loop.arm)
        self._scene.on_drag(self._drag_target, self._drag_pointer, self._drag_obstacle)
        with self._server.gui.add_folder("Plots", order=20, expand_by_default=False):
            self._plots = Plots(self._server.gui, loop.arm)
        self._trail: deque[tuple[np.ndarray, np.ndarray]] = deque(maxlen=round(TRAIL * loop.arm.control_rate))
        self._before: Snapshot | None = None
        self._shown: Snapshot | None = None
        self._gap = 0.0
        self._gap_of: Point | None = None
        self.frames = 0
        self._server.on_client_connect(self._joined)
        self._server.on_client_disconnect(self._left)
        self._closing, self._changing = threading.Event(), threading.Lock()
        self._survey = survey
        self._gap_at: Callable[[Point], float] = _unknown
        self._drawing = threading.Thread(target=self._draw_on, name="scene", daemon=True)
        self._drawing.start()
        self.gate = Gate(port, self._server.get_port(), secret)

    def close(self) -> None:
        """Close the gate and the page; the loop goes on."""
        self._closing.set()
        self._drawing.join(2.0)
        self.gate.close()
        with redirect_stdout(io.StringIO()):
            self._server.stop()

    async def _joined(self, client: viser.ClientHandle) -> None:
        if client.camera.image_height > 1.2 * client.camera.image_width:
            client.camera.position = self._arm.length * np.array(UPRIGHT_CAMERA)
            client.camera.look_at = self._arm.length * np.array(UPRIGHT_LOOK_AT)
        self._panels[client.client_id] = Panel(client, self._desk)
        self.session.join(client.client_id)

    async def _left(self, client: viser.ClientHandle) -> None:
        self._panels.pop(client.client_id, None)
        self.session.leave(client.client_id)

    def _session_changed(self) -> None:
        """Nobody at the handle: the arm holds. Somebody new: it goes on from where it is, unless it was stopped."""
        if self._loop.latest is None:
            return  # `_draw` calls this again when there is something to drive
        with self._changing:  # from viser's thread, and once from the one that draws
            driven, wish = self.session.driver is not None, self._loop.wish
            if driven and not wish.driven:
                latest = self._loop.latest
                start = {} if latest is None or wish.task else {"target": tuple(latest.states[-1, POSITION])}
                self._loop.ask(driven=True, **start)
            elif not driven:
                self._loop.ask(driven=False)
            for panel in list(self._panels.values()):
                panel.refresh()

    def _tell(self, text: str) -> None:
        for client in self._server.get_clients().values():
            client.add_notification(title="s2c2a", body=text, auto_close_seconds=6.0)

    def _drag_target(self, who: int, where: Point) -> None:
        if self.session.drives(who) and self._loop.wish.task is None:
            self._loop.ask(target=where)

    def _drag_pointer(self, who: int, where: Point) -> None:
        wish = self._loop.wish
        if self.session.drives(who) and wish.task is None and wish.target is not None:
            self._loop.ask(axis=self._scene.axis_towards(wish.target, where))

    def _drag_obstacle(self, who: int, number: int, where: Point) -> None:
        own = self._loop.wish.obstacles
        if self.session.drives(who) and number < len(own):
            moved = Obstacle(where, own[number].threshold)
            self._loop.ask(obstacles=(*own[:number], moved, *own[number + 1 :]))

    def _look_round(self, survey: Callable[[], Survey]) -> None:
        found = survey()
        if self._closing.is_set():
            return
        self._scene.draw_cloud(found.cloud)
        self._gap_at, self._gap_of = found.gap, None

    def _draw_on(self) -> None:
        """One frame after the other, until the page closes; a late frame is left out."""
        for _ in beats(FRAME, self._closing):
            self._draw()
            self.frames += 1

    def _draw(self) -> None:
        latest = self._loop.latest
        if latest is None:
            return
        new, first = latest is not self._shown, self._shown is None
        if new:
            self._before, self._shown = self._shown or latest, latest
            self._plots.add(latest)
            self._trail.append((latest.states[-1, POSITION].copy(), _wanted(latest)))
        if first:
            if self._survey is not None:
                threading.Thread(target=self._look_round, args=(self._survey,), daemon=True).start()
            if self.session.present:
                self._session_changed()
        share = self._share_of_step(latest)
        if share is not None and self._before is not None:
            self._scene.draw_arm(between(self._before.states, latest.states, share))
            ghost = between(self._before.expected, latest.expected, share) if self._view.ghost else None
            self._scene.draw_ghost(ghost, latest.states)
        self._draw_asked(latest)
        if new:
            self._draw_trails()
            self._scene.draw_load(latest.states[-1, POSITION], self._loop.wish, self._loop.limits)
        if first or self.frames % PLOT_EVERY == 0:
            self._plots.draw()
            self._scene.show_cloud(self._view.cloud)
            self._status.content = self._status_of(latest)

    def _share_of_step(self, latest: Snapshot) -> float | None:
        """How far between the last two states the picture is now; None where it stands."""
        share = (time.perf_counter() - latest.moment) / latest.period
        return None if share > 1.5 else float(np.clip(share, 0.0, 1.0))

    def _draw_asked(self, latest: Snapshot) -> None:
        wish, tip = self._loop.wish, latest.states[-1, POSITION]
        position, axis = (wish.target, wish.axis) if wish.task is None else _asked_of_tip(latest)
        self._scene.draw_target(position, axis, self._reach_gap(position))
        own = wish.obstacles
        asked = _task_obstacles(latest, len(own)) if wish.task else ()
        self._scene.draw_obstacles(own, asked, tip)

    def _reach_gap(self, position: Point | None) -> float:
        """How far out of reach the target is [m]; asked of one point at a time, so that it compiles once."""
        if position is None:
            return 0.0
        if position != self._gap_of:
            self._gap, self._gap_of = self._gap_at(position), position
        return self._gap

    def _draw_trails(self) -> None:
        shown = self._view.trails and len(self._trail) > 1
        real, wanted = np.swapaxes(np.array(self._trail), 0, 1) if shown else np.zeros((2, 0, 3))
        self._scene.draw_trail("real", real)
        self._scene.draw_trail("wanted", wanted)

    def _status_of(self, latest: Snapshot) -> str:
        driver, others = self.session.driver, len(self.session.present) - (self.session.driver is not None)
        who = "nobody drives" if driver is None else "one drives"
        lines = [f"**{self._arm.name}** · {latest.strategy} · {who}" + (f", {others} watch" if others else "")]
        if latest.stage is Stage.FAILED:
            return f"{lines[0]}\n\n**stopped:** {latest.fault}"
        said = [latest.stage.value if latest.stage is not Stage.DRIVEN or not self._loop.wish.stopped else "stopped"]
        if np.isfinite(latest.error):
            said.append(f"error {100 * latest.error:.1f} cm")
        if np.isfinite(latest.clearance):
            said.append(f"clearance {100 * latest.clearance:.1f} cm")
        if latest.task_steps:
            over = latest.task_step + 1 == latest.task_steps
            said.append("task finished" if over else f"step {latest.task_step + 1} of {latest.task_steps}")
        if self._desk.recorder.running:
            said.append("recording")
        if self._gap > 0.005:
            said.append(f"**{100 * self._gap:.1f} cm out of reach**")
        return f"{lines[0]}\n\n{' · '.join(said)}"


def _unknown(_position: Point) -> float:
    """No gap, while nobody knows."""
    return 0.0


def between(before: States, after: States, share: float) -> States:
    """States on the way from one to the next, axes of unit length."""
    states = (1 - share) * before + share * after
    states[:, AXIS] /= np.maximum(np.linalg.norm(states[:, AXIS], axis=-1, keepdims=True), 1e-9)
    return states


def _wanted(snapshot: Snapshot) -> np.ndarray:
    asked = float(np.asarray(snapshot.goal.position_weights)[-1]) > 0
    return np.array(snapshot.goal.positions[-1], float) if asked else np.full(3, np.nan)


def _asked_of_tip(snapshot: Snapshot) -> tuple[Point | None, Point | None]:
    wanted, goal = _wanted(snapshot), snapshot.goal
    pointed = float(np.asarray(goal.axis_weights)[-1]) > 0
    position = tuple(wanted) if np.isfinite(wanted).all() else None
    return position, tuple(np.array(goal.axes[-1], float)) if pointed else None


def _task_obstacles(snapshot: Snapshot, own: int) -> tuple[Obstacle, ...]:
    """The task's obstacles come first in a goal, the driver's after them."""
    thresholds = np.asarray(snapshot.goal.thresholds)
    count = int((thresholds > 0).sum()) - own
    centres = np.asarray(snapshot.goal.obstacles, float)
    return tuple(Obstacle(tuple(centres[k]), float(thresholds[k])) for k in range(max(count, 0)))
