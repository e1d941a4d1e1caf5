"""The page: a window on an arm that moves, drawn at its own rate, with a panel for everyone who comes."""

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

from s2c2a.evaluation import belief_said
from s2c2a.live.panel import Panel
from s2c2a.live.plots import Plots
from s2c2a.live.recorder import Recorder
from s2c2a.live.request import Point, point
from s2c2a.live.session import CLOUD, GHOST, TRAILS, Session
from s2c2a.live.snapshot import Control, Snapshot
from s2c2a.live.window import Window
from s2c2a.spaces import POSITION, Stage

TRAIL = 15.0  # s
PLOT_EVERY = 8  # frames
MIN_GAP = 0.005  # m; a target less far out of reach is within it
PREPARING = "preparing the arm: the first start on a machine compiles, which takes up to half a minute"


Survey = tuple[Float[np.ndarray, "modules points 3"], Callable[[Point], float]]
"""Where an arm can be: ends of its modules [m], and how far out of the tip's reach a
point is [m]."""


class LivePage(Window):
    """The live page of one arm; closing it leaves the arm to itself.

    Attributes:
        session: who drives.
        frames: drawn so far.
    """

    def __init__(
        self,
        control: Control,
        port: int,
        runs: Path,
        survey: Callable[[], Survey] | None = None,
    ):
        """Open the page of an arm that moves, or will soon: until its first snapshot the page says that it prepares.

        Args:
            control: moves the arm.
            port: where the page shall be; the next free one if it is taken.
            runs: where recordings go.
            survey: finds out where the arm can be; called once the arm is there, in a
                thread of its own.

        Raises:
            S2C2AError: no port is free.
        """
        super().__init__(control.arm)
        self._control = control
        self._survey = survey
        gui = self.server.gui
        self.session = Session(self._session_changed)
        self._panels = dict[int, Panel]()
        self._recorder = Recorder(control, runs)
        self._status = gui.add_markdown(f"**{self.arm.name}** · {PREPARING}", order=0)
        self.scene.on_drag(self._drag_target, self._drag_pointer, self._drag_obstacle)
        with gui.add_folder("Plots", order=20, expand_by_default=False):
            self._plots = Plots(gui, self.arm)
        self._trail: deque[np.ndarray] = deque(
            maxlen=round(TRAIL * self.arm.control_rate)
        )
        self._steps: deque[Snapshot] = deque(maxlen=2)
        # while nobody knows
        self._gap = 0.0
        self._gap_at = lambda where: 0.0
        self.frames = 0
        self._changing = threading.Lock()
        self.server.on_client_connect(self._joined)
        self.server.on_client_disconnect(self._left)
        self.every(self._draw)
        self.open(port, lambda: control.halt("by somebody who looks at this page"))

    def close(self) -> None:
        """See `Window`; what is being recorded is written."""
        try:
            self._recorder.stop()
        finally:
            super().close()

    async def _joined(self, client: viser.ClientHandle) -> None:
        self._panels[client.client_id] = Panel(
            client, self._control, self.session, self._recorder, self._tell
        )
        self.session.join(client.client_id)

    async def _left(self, client: viser.ClientHandle) -> None:
        self._panels.pop(client.client_id, None)
        self.session.leave(client.client_id)

    def _session_changed(self) -> None:
        """Nobody at the handle: the arm holds. Somebody new: it goes on from where it is, unless it was stopped."""
        latest = self._control.latest
        if latest is None:
            return  # `_draw` calls this again when there is something to drive
        with self._changing:  # from viser's thread, and once from the one that draws
            driven = self.session.driver is not None
            request = self._control.request
            if driven and not request.driven:
                start = (
                    {}
                    if request.task
                    else {"target": tuple(latest.states[-1, POSITION])}
                )
                self._control.ask(driven=True, **start)
            elif not driven:
                self._control.ask(driven=False)
            for panel in list(self._panels.values()):
                panel.refresh()

    def _tell(self, text: str) -> None:
        for client in self.server.get_clients().values():
            client.add_notification(title="s2c2a", body=text, auto_close_seconds=6.0)

    def _drag_target(self, who: int, where: Point) -> None:
        if self.session.drives(who) and self._control.request.task is None:
            self._control.ask(target=where)

    def _drag_pointer(self, who: int, where: Point) -> None:
        request = self._control.request
        if (
            self.session.drives(who)
            and request.task is None
            and request.target is not None
        ):
            self._control.ask(axis=point(np.subtract(where, request.target)))

    def _drag_obstacle(self, number: int, who: int, where: Point) -> None:
        own = self._control.request.obstacles
        if self.session.drives(who) and number < len(own):
            self._control.ask(
                obstacles=(
                    *own[:number],
                    replace(own[number], center=where),
                    *own[number + 1 :],
                )
            )

    def _look_round(self) -> None:
        if self._survey is not None:
            cloud, gap = self._survey()
            if not self.closing.is_set():
                self.scene.draw_cloud(cloud)
                self._gap_at = lru_cache(maxsize=1)(gap)

    def _draw(self, _passed: float) -> None:
        """One frame."""
        latest = self._control.latest
        if latest is None:
            return
        if not self._steps:
            threading.Thread(target=self._look_round, daemon=True).start()
            if self.session.present:
                self._session_changed()
        if not self._steps or latest.step is not self._steps[-1].step:
            self._steps.append(latest)
            self._plots.add(latest)
            self._draw_trails(latest)
            self.scene.draw_load(
                latest.states[-1, POSITION], self._control.request, self._control.limits
            )
        self._draw_arm(latest)
        self._draw_asked(latest)
        if self.frames % PLOT_EVERY == 0:
            self._say(latest)
        self.frames += 1

    def _draw_trails(self, latest: Snapshot) -> None:
        self._trail.append(np.array([latest.states[-1, POSITION], _desired(latest)[0]]))
        points = (
            np.array(self._trail) if self.session.view[TRAILS] else np.zeros((0, 2, 3))
        )
        self.scene.draw_trail("real", points[:, 0])
        self.scene.draw_trail("desired", points[:, 1])

    def _draw_arm(self, latest: Snapshot) -> None:
        """Between the last two states, as far as time has come; it stands where nothing comes any more."""
        share = (time.perf_counter() - latest.step.moment) / self.arm.control_period
        before = self._steps[0]
        if share > 1.5:
            return
        share = min(max(share, 0.0), 1.0)
        self.scene.draw_arm((1 - share) * before.states + share * latest.states)
        expected = (1 - share) * before.expected + share * latest.expected
        self.scene.draw_ghost(
            expected if self.session.view[GHOST] else None, latest.states
        )

    def _draw_asked(self, latest: Snapshot) -> None:
        request = self._control.request
        goal = latest.step.goal
        position = request.target
        axis = request.axis
        spheres = np.zeros((0, 4))
        if request.task is not None and goal is not None:
            position, axis = _desired(latest)
            spheres = goal.obstacles_in_use()
            # the driver's come after the task's
            spheres = spheres[: max(len(spheres) - len(request.obstacles), 0)]
        self._gap = (
            self._gap_at(point(position))
            if position is not None and np.isfinite(position).all()
            else 0.0
        )
        self.scene.draw_target(position, axis, self._gap)
        self.scene.draw_obstacles(
            request.obstacles, spheres, latest.states[-1, POSITION]
        )

    def _say(self, latest: Snapshot) -> None:
        """What is shown now and then only: plots, words, buttons."""
        self._plots.draw()
        self.scene.show_cloud(self.session.view[CLOUD])
        self._status.content = self._status_of(latest)
        for panel in list(self._panels.values()):
            panel.follow()

    def _status_of(self, latest: Snapshot) -> str:
        driver = self.session.driver
        others = len(self.session.present) - (self.session.driver is not None)
        who = "nobody drives" if driver is None else "one drives"
        head = f"**{self.arm.name}** · {latest.strategy} · {who}" + (
            f", {others} watch" if others else ""
        )
        if latest.stage is Stage.FAULT:
            return f"{head}\n\n**stopped:** {latest.fault}"
        stopped = (
            f"**stopped:** {self._control.halted_by}"
            if self._control.request.stopped
            else ""
        )
        said = {
            stopped or str(latest.stage): True,
            f"error {100 * latest.error:.1f} cm": np.isfinite(latest.error),
            f"clearance {100 * latest.clearance:.1f} cm": np.isfinite(latest.clearance),
            f"step {latest.task_step + 1} of {latest.task_steps}": latest.task_steps
            and not latest.finished,
            "task finished": latest.finished,
            "recording": self._recorder.running,
            f"**{100 * self._gap:.1f} cm out of reach**": self._gap > MIN_GAP,
            "nothing watches this arm: drawn as its model expects it": "states"
            not in latest.step.reading.sensors,
            f"**{latest.fault}**": latest.fault,
        }
        believed = belief_said(latest.step.diagnostics)
        return "\n\n".join(
            [
                head,
                " · ".join(text for text, shown in said.items() if shown),
                *[believed] * bool(believed),
            ]
        )


def _desired(snapshot: Snapshot) -> Float[np.ndarray, "2 3"]:
    """Position and axis that are asked of the tip; NaN where they are not."""
    goal = snapshot.step.goal
    if goal is None:
        return np.full((2, 3), np.nan)
    return np.array([goal.desired_positions()[-1], goal.desired_axes()[-1]], float)
