"""Live page of a moving arm: scene, status, plots, and a panel for each browser."""

import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import viser
from jaxtyping import Float

from s2c2a.evaluation import (
    DisagreementWatch,
    describe_saturation,
    describe_step_estimates,
    describe_step_plan,
)
from s2c2a.live.browsers import CLOUD, GHOST, TRAILS, Browsers
from s2c2a.live.gate import HOST
from s2c2a.live.panel import Panel
from s2c2a.live.plots import Plots
from s2c2a.live.recorder import Recorder
from s2c2a.live.request import Point, point
from s2c2a.live.scene import REACH_TOLERANCE
from s2c2a.live.snapshot import Control, Snapshot
from s2c2a.live.steering import Steering, across_view, largest_speed, moved_target
from s2c2a.live.window import Window
from s2c2a.obstacles import ROW
from s2c2a.runtime import StepRecord
from s2c2a.spaces import POSITION, Stage
from s2c2a.viz.mounting import Mounting

TRAIL = 15.0  # s
PLOT_EVERY = 8  # frames
STOP_TIMEOUT = 1.5  # s, below the 2 s that the Stop button waits
PREPARING = "preparing the arm; the first start compiles for one or two minutes"
MODEL_DRAWN = "no measured states: the arm is drawn as its model predicts"
STOP_PRESSED = "Stop was pressed on this page"

Survey = tuple[Float[np.ndarray, "modules points 3"], Callable[[Point], float]]
"""Workspace of an arm: ends of its modules [m], and the distance of a point from the
tip's reach [m]."""


class LivePage(Window):
    """The live page of one arm; closing it does not stop the control.

    Attributes:
        browsers: which browser drives.
        frames: number of drawn frames.
    """

    def __init__(
        self,
        control: Control,
        port: int,
        runs: Path,
        survey: Callable[[], Survey] | None = None,
        host: str = HOST,
    ):
        """Open the page; until the first snapshot it shows that the arm is prepared.

        Args:
            control: moves the arm.
            port: of the page; the next free one if it is taken.
            runs: folder of the recordings.
            survey: computes the workspace; called after the first snapshot, in a
                separate thread.
            host: address to listen on.

        Raises:
            S2C2AError: no port is free.
        """
        super().__init__(control.arm)
        self._control = control
        self._survey = survey
        gui = self.server.gui
        self.browsers = Browsers(self._browsers_changed)
        self._panels = dict[int, Panel]()
        self._recorder = Recorder(control, runs)
        self._steering = Steering()
        self._up = Mounting.of(self.arm).turn[2]
        self._status = gui.add_markdown(f"**{self.arm.name}** · {PREPARING}", order=0)
        self.scene.on_drag(
            self._drag_target, self._drag_pointer, self._drag_obstacle, self._drag_end
        )
        with gui.add_folder("Plots", order=20, expand_by_default=False):
            self._plots = Plots(gui, self.arm)
        self._trail: deque[np.ndarray] = deque(
            maxlen=round(TRAIL * self.arm.control_rate)
        )
        self._sent: deque[np.ndarray] = deque(maxlen=self._trail.maxlen)
        self._snapshots: deque[Snapshot] = deque(maxlen=2)
        self._drawn: StepRecord | None = None
        self._disagreement = DisagreementWatch(self.arm)
        # every step counts; a frame may come after several
        self._watched: deque[StepRecord] = deque()
        self._unwatch = control.watch(lambda seen: self._watched.append(seen.step))
        # zero until the survey
        self._gap = 0.0
        self._gap_at = lambda position: 0.0
        self.frames = 0
        self._changing = threading.Lock()
        self.server.on_client_connect(self._add_client)
        self.server.on_client_disconnect(self._remove_client)
        self.every(self._draw)
        self.open(port, self._stop, host, self._steer)

    def close(self) -> None:
        """See `Window`; writes a recording that runs."""
        self._unwatch()
        try:
            self._recorder.stop()
        finally:
            super().close()

    async def _add_client(self, client: viser.ClientHandle) -> None:
        self._panels[client.client_id] = Panel(
            client, self._control, self.browsers, self._recorder, self._notify
        )
        self.browsers.join(client.client_id)

    async def _remove_client(self, client: viser.ClientHandle) -> None:
        self._panels.pop(client.client_id, None)
        self.browsers.leave(client.client_id)

    def _stop(self) -> str:
        """Stop the arm; returns what it then does, or nothing if it does not obey."""
        self._control.halt(STOP_PRESSED)
        deadline = time.monotonic() + STOP_TIMEOUT
        while self._control.responds and time.monotonic() < deadline:
            latest = self._control.latest
            if latest is not None and latest.stage is Stage.RELEASE:
                return "Returning to rest"
            if latest is None or latest.stage is not Stage.RUN:
                return "Stopped"
            time.sleep(0.02)
        return ""

    def _browsers_changed(self) -> None:
        """Hold the arm without a driver; a new driver starts from the arm's pose."""
        latest = self._control.latest
        if latest is None:
            return  # `_draw` repeats this call after the first snapshot
        with self._changing:  # called by viser's thread, and once by `_draw`
            driven = self.browsers.driver is not None
            request = self._control.request
            if not driven:
                self._control.ask(driven=False)
            elif not request.driven and request.task:
                self._control.ask(driven=True)
            elif not request.driven:
                self._control.ask(driven=True, target=latest.tip)
            for panel in list(self._panels.values()):
                panel.refresh()

    def _notify(self, text: str) -> None:
        for client in self.server.get_clients().values():
            client.add_notification(title="s2c2a", body=text, auto_close_seconds=6.0)

    def _steer(self, key: str, direction: Point) -> None:
        """Steer the target, if the key is that of the browser that drives."""
        panel = self._panels.get(self._driver)
        if panel is not None and panel.steering_key == key:
            self._steering.set(direction)

    @property
    def _driver(self) -> int:
        """Client number of the browser that drives; -1 without one."""
        driver = self.browsers.driver
        return -1 if driver is None else driver

    def _move_target(self, elapsed: float) -> None:
        """Move the target as the driver steers, seen from the driver's camera.

        Args:
            elapsed: since the last frame [s].
        """
        direction = self._steering.direction()
        client = self.server.get_clients().get(self._driver)
        request = self._control.request
        moves = request.driven and not request.stopped and request.task is None
        if direction is None or client is None or request.target is None or not moves:
            return
        camera = client.camera
        level = across_view(direction, camera.position, camera.look_at, self._up)
        velocity = point(largest_speed(self.arm) * level)
        target = moved_target(request.target, velocity, elapsed, self.arm)
        self._control.ask(target=target)

    def _drag_target(self, client: int, position: Point) -> None:
        if self.browsers.drives(client) and self._control.request.task is None:
            self._control.ask(target=position)

    def _drag_pointer(self, client: int, position: Point) -> None:
        request = self._control.request
        if not self.browsers.drives(client) or request.task is not None:
            return
        if request.target is not None:
            self._control.ask(axis=point(np.subtract(position, request.target)))

    def _drag_obstacle(self, number: int, client: int, position: Point) -> None:
        obstacles = list(self._control.request.obstacles)
        if self.browsers.drives(client) and number < len(obstacles):
            obstacles[number] = replace(obstacles[number], center=position)
            self._control.ask(obstacles=tuple(obstacles))

    def _drag_end(self, number: int, client: int, position: Point) -> None:
        shape = self._control.request.shape
        if self.browsers.drives(client) and shape is not None:
            ends = [*shape]
            ends[number] = position
            self._control.ask(shape=ends)

    def _run_survey(self) -> None:
        if self._survey is not None:
            cloud, gap = self._survey()
            if not self.closing.is_set():
                self.scene.draw_cloud(cloud)
                self._gap_at = lru_cache(maxsize=1)(gap)

    def _draw(self, elapsed: float) -> None:
        """Draw one frame, after the target has moved."""
        self._move_target(elapsed)
        latest = self._control.latest
        if latest is None:
            return
        if not self._snapshots:
            threading.Thread(target=self._run_survey, daemon=True).start()
            if self.browsers.present:
                self._browsers_changed()
        if not self._snapshots or latest.step is not self._snapshots[-1].step:
            self._snapshots.append(latest)
            self._plots.add(latest)
            steps = [self._watched.popleft() for _ in range(len(self._watched))]
            self._disagreement.add(steps)
            self._sent += [step.action for step in steps if step.stage is Stage.RUN]
            self._draw_trails(latest)
            control = self._control
            self.scene.draw_payload(latest.tip, control.request, control.limits)
        self._draw_arm(latest)
        # draw the target and the obstacles of the request and of the task
        request = self._control.request
        goal = latest.step.goal
        position = request.target
        axis = request.axis
        of_task = np.zeros((0, ROW))
        if request.task is not None and goal is not None:
            position, axis = _desired(latest)
            rows = goal.obstacles_in_use()
            # the driver's obstacles come after the task's
            of_task = rows[: max(len(rows) - len(request.obstacles), 0)]
        self._gap = 0.0
        if position is not None and np.isfinite(position).all():
            self._gap = self._gap_at(point(position))
        self.scene.draw_target(position, axis, self._gap)
        self.scene.draw_shape(request.ends)
        self.scene.draw_obstacles(request.obstacles, of_task, latest.tip)
        if self.frames % PLOT_EVERY == 0:
            # update what need not change in every frame: plots, status, buttons
            self._plots.draw()
            self.scene.show_cloud(self.browsers.view[CLOUD])
            self._status.content = self._status_of(latest)
            for panel in list(self._panels.values()):
                panel.follow()
        self.frames += 1

    def _draw_trails(self, latest: Snapshot) -> None:
        self._trail.append(np.array([latest.tip, _desired(latest)[0]]))
        visible = self.browsers.view[TRAILS]
        points = np.array(self._trail) if visible else np.zeros((0, 2, 3))
        self.scene.draw_trail("real", points[:, 0])
        self.scene.draw_trail("desired", points[:, 1])
        ahead = latest.step.diagnostics.get("horizon", np.zeros((0, 3)))
        self.scene.draw_trail("horizon", ahead if visible else ahead[:0])

    def _draw_arm(self, latest: Snapshot) -> None:
        """Interpolate between the last two snapshots; stand still without new ones."""
        if latest.step is self._drawn:
            return
        age = time.perf_counter() - latest.step.moment
        share = min(max(age / self.arm.control_period, 0.0), 1.0)
        last = self._snapshots[0]
        self.scene.draw_arm((1 - share) * last.states + share * latest.states)
        ghost = None
        if self.browsers.view[GHOST]:
            ghost = (1 - share) * last.predicted + share * latest.predicted
        self.scene.draw_ghost(ghost, latest.states)
        # in the planned arm's place, and shown with it
        known = latest.predictive_std if ghost is not None else 0.0
        tip = latest.predicted if ghost is None else ghost
        self.scene.draw_uncertainty(tip[-1, POSITION], known)
        # a late snapshot, too, is drawn once to its end
        self._drawn = latest.step if share == 1.0 else None

    def _status_of(self, latest: Snapshot) -> str:
        """Markdown of the status: who drives, what the arm does, the estimate."""
        browsers = self.browsers
        driven = browsers.driver is not None
        watching = len(browsers.present) - driven
        head = f"**{self.arm.name}** · {latest.strategy} · "
        head += "one browser drives" if driven else "no driver"
        if watching:
            head += f", {watching} watching"
        if latest.stage is Stage.FAULT:
            return f"{head}\n\n**stopped:** {latest.fault}"
        details = " · ".join([self._motion(latest), *self._details(latest)])
        estimate = describe_step_estimates(latest.step.diagnostics)
        return f"{head}\n\n{details}\n\n{estimate}"

    def _motion(self, latest: Snapshot) -> str:
        """What the arm does; "stopped" only while it holds or is at rest."""
        if not self._control.request.stopped:
            return str(latest.stage)
        if latest.stage is Stage.RUN:
            return "stopping"
        if latest.stage is Stage.RELEASE:
            return f"{latest.stage} after a stop"
        return f"**stopped:** {self._control.halted_by}"

    def _details(self, latest: Snapshot) -> list[str]:
        """Errors, task, recording and warnings that apply now."""
        error = latest.error
        clearance = latest.clearance
        step = f"step {latest.task_step + 1} of {latest.task_steps}"
        measured = "states" in latest.step.reading.sensors
        plan = describe_step_plan(latest.step.diagnostics)
        saturation = self._saturation()
        texts = {
            f"error {100 * error:.1f} cm": np.isfinite(error),
            f"clearance {100 * clearance:.1f} cm": np.isfinite(clearance),
            "task finished" if latest.finished else step: latest.task_steps,
            "recording": self._recorder.running,
            f"**{100 * self._gap:.1f} cm out of reach**": self._gap > REACH_TOLERANCE,
            f"**{plan}**": plan,
            f"**{saturation}**": saturation,
            MODEL_DRAWN: not measured,
            f"**{latest.fault}**": latest.fault,
            f"**the strategy ignores {latest.ignored}**": latest.ignored,
            f"**{self._disagreement.text}**": self._disagreement.text,
        }
        return [text for text, applies in texts.items() if applies]

    def _saturation(self) -> str:
        """Sentence on commands at the limits of their range, lately."""
        if not self._sent:
            return ""
        text = describe_saturation(self.arm, np.array(self._sent))
        return text and f"in the last {TRAIL:.0f} s of motion, {text}"


def _desired(snapshot: Snapshot) -> Float[np.ndarray, "2 3"]:
    """Desired position and axis of the tip; NaN where undefined."""
    goal = snapshot.step.goal
    if goal is None:
        return np.full((2, 3), np.nan)
    axis = goal.desired_axes()[-1]
    return np.array([goal.desired_positions()[-1], axis], float)
