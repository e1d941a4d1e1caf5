"""One browser's panel: everything to ask with for the driver, a button to take the handle for the others.

Stop is not here: the gate gives one to everybody who looks at the page.
"""

import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import viser
from jaxtyping import Float

from s2c2a.errors import S2C2AError
from s2c2a.live.hints import OBSTACLES, hint_for
from s2c2a.live.knobs import SPEED, WEIGHTS, Knob, faults
from s2c2a.live.recorder import Recorder
from s2c2a.live.request import MOST_OBSTACLES, Obstacle, Request
from s2c2a.live.session import Session
from s2c2a.live.snapshot import Control
from s2c2a.live.window import across_the_screen, sound_value
from s2c2a.spaces import AXIS, POSITION

DRAG = "drag the target"
NEW_THRESHOLD = 0.1  # of the arm's length
BESIDE = 0.35  # of the arm's length: how far from the tip a new obstacle appears
COUPLED = 3  # modules of the paper's arm, whose sensors leak
GHOST, TRAILS, CLOUD = "Planned arm", "Trails", "Workspace"  # what can be shown beside the arm


@dataclass(frozen=True)
class Desk:
    """What panels work on.

    Attributes:
        control: moves the arm.
        session: says who drives.
        recorder: keeps what happens.
        view: what is shown beside the arm, by its label.
        tell: says something to all browsers.
    """

    control: Control
    session: Session
    recorder: Recorder
    view: dict[str, bool]
    tell: Callable[[str], None]


class Panel:
    """The panel of one browser; built anew when its part changes."""

    def __init__(self, client: viser.ClientHandle, desk: Desk):
        """An empty panel."""
        self._me, self._gui, self._desk = client.client_id, client.gui, desk
        self._role: tuple | None = None
        self._building = threading.Lock()
        self._followers: list[Callable[[Request], None]] = []

    def refresh(self) -> None:
        """Build what this browser may do now, if that has changed."""
        driver = self._desk.session.driver
        role = (driver == self._me, driver is None)
        with self._building:
            if role == self._role:
                return
            self._role = role
            self._followers.clear()
            self._gui.reset()
            if driver == self._me:
                self._build_driver()
            else:
                self._build_watcher(free=driver is None)
        self.follow()

    def follow(self) -> None:
        """Show what the request has become, whoever changed it."""
        request = self._request
        with self._building, suppress(RuntimeError):  # parts of a browser that goes at this moment
            for follower in self._followers:
                follower(request)

    def _build_watcher(self, free: bool) -> None:
        label = "Take the handle" if free else "Somebody else drives"
        take = self._gui.add_button(label, disabled=not free, color="blue", icon=viser.Icon.HAND_GRAB, order=10)
        self._clicked(take, lambda: self._desk.session.take(self._me), anybody=True)

    def _build_driver(self) -> None:
        go_on = self._button("Go on", lambda: self._ask(stopped=False), color="green", order=-1)
        self._followers.append(lambda request: setattr(go_on, "visible", request.stopped))
        tabs = self._gui.add_tab_group(order=11)
        for label, build in (
            ("Task", self._build_task),
            ("Avoid", self._build_obstacles),
            ("Plan", self._build_planner),
            ("Faults", self._build_faults),
            ("More", self._build_more),
        ):
            with tabs.add_tab(label):
                build()

    def _build_task(self) -> None:
        control, gui = self._desk.control, self._gui
        hint = gui.add_markdown("")
        names = (DRAG, *control.limits.tasks)
        task = gui.add_dropdown("Task", names, initial_value=self._request.task or DRAG)
        play = self._button("Play", self._play)
        of_task: list[Any] = [play, self._button("One step", control.step_task)]
        of_task += [self._button("From the start", control.restart_task), self._slider(SPEED)]
        pointed = gui.add_checkbox("A direction too", self._request.axis is not None)
        of_drag = [pointed, self._button("Target to the tip", self._target_to_tip)]

        def follow(request: Request) -> None:
            hint.content = hint_for(request.task)
            play.label = "Pause" if request.playing and not self._over else "Play"
            for part in (*of_task, *of_drag):
                part.visible = (request.task is not None) == (part in of_task)

        self._followers.append(follow)
        self._changed(task, self._choose)
        self._changed(pointed, lambda on: self._ask(axis=tuple(self._tip[AXIS]) if on else None))

    def _choose(self, name: str) -> None:
        self._ask(task=None if name == DRAG else name, playing=False)
        if name == DRAG:
            self._target_to_tip()

    def _play(self) -> None:
        if self._over:
            self._desk.control.restart_task()
        self._ask(playing=self._over or not self._request.playing)

    def _build_obstacles(self) -> None:
        self._gui.add_markdown(OBSTACLES)
        first = round(min(100 * NEW_THRESHOLD * self._desk.control.arm.length, 20.0), 1)

        def put() -> None:
            own = self._request.obstacles
            if len(own) >= MOST_OBSTACLES:
                return self._desk.tell(f"{MOST_OBSTACLES} obstacles are the most")
            self._ask(obstacles=(*own, Obstacle(self._beside_tip(len(own)), sound_value(threshold) / 100)))

        def resize(value: float) -> None:
            own = self._request.obstacles
            self._ask(obstacles=(*own[:-1], *(replace(one, threshold=value / 100) for one in own[-1:])))

        self._button("Add one", put)
        self._button("Remove the last", lambda: self._ask(obstacles=self._request.obstacles[:-1]))
        threshold = self._gui.add_slider("Threshold r [cm]", min(first, 1.0), 20.0, 0.1, first)
        self._changed(threshold, resize)

    def _build_planner(self) -> None:
        names, latest = self._desk.control.strategies, self._desk.control.latest
        now = latest.strategy if latest and latest.strategy in names else names[0]
        chosen = self._gui.add_dropdown("Driven by", names, initial_value=now)
        self._gui.add_markdown("How much each request weighs, times what it does:")
        for knob in WEIGHTS:
            self._slider(knob)

        def change(name: str) -> None:
            self._desk.tell(f"{name}: preparing …")
            self._desk.control.use(name)
            self._desk.tell(f"{name} drives")

        self._changed(chosen, change, slow=True)

    def _build_faults(self) -> None:
        control = self._desk.control
        knobs = [knob for knob in faults(control.limits, control.arm.module_count == COUPLED) if knob.high > knob.low]
        sliders = [self._slider(knob) for knob in knobs]

        def clear() -> None:
            self._ask(payload=0.0, push=(0.0, 0.0, 0.0), noise=0.0, coupling=0.0)
            for slider in sliders:
                slider.value = 0.0  # type: ignore[misc] # viser hides the setter from type checkers

        self._button("No faults", clear)

    def _build_more(self) -> None:
        recorder, view = self._desk.recorder, self._desk.view
        record = self._button("Record", self._record, slow=True)
        self._followers.append(lambda _: setattr(record, "label", "Stop recording" if recorder.running else "Record"))
        self._button("Reset the arm", self._desk.control.reset)
        self._button("Let others drive", lambda: self._desk.session.give(self._me))
        for label, shown in view.items():
            self._changed(self._gui.add_checkbox(label, shown), partial(view.__setitem__, label))

    def _record(self) -> None:
        recorder = self._desk.recorder
        if not recorder.running:
            return recorder.start()
        folder = recorder.stop()
        self._desk.tell(f"written; look at it with: s2c2a view {folder}" if folder else "too short to keep")

    @property
    def _request(self) -> Request:
        return self._desk.control.request

    @property
    def _over(self) -> bool:
        """Whether the task that is played has come to its end."""
        latest = self._desk.control.latest
        return latest is not None and latest.finished

    def _ask(self, **changes: Any) -> None:
        self._desk.control.ask(**changes)

    @property
    def _tip(self) -> Float[np.ndarray, "6"]:
        """Its state; nobody has a panel before the arm has moved."""
        latest = self._desk.control.latest
        return np.zeros(6) if latest is None else latest.states[-1]

    def _target_to_tip(self) -> None:
        self._ask(target=tuple(self._tip[POSITION]), axis=None)

    def _beside_tip(self, number: int):
        """Clear of the tip, as far from whoever looks from where the page begins, each on another side."""
        arm = self._desk.control.arm
        away = BESIDE * arm.length * (1 + number // 2) * (-1) ** number
        return tuple(self._tip[POSITION] + away * across_the_screen(arm))

    def _button(self, label: str, act: Callable[[], Any], slow: bool = False, **options: Any) -> viser.GuiButtonHandle:
        button = self._gui.add_button(label, **({"color": "gray"} | options))
        self._clicked(button, act, slow)
        return button

    def _slider(self, knob: Knob) -> viser.GuiSliderHandle:
        slider = self._gui.add_slider(knob.label, knob.low, knob.high, knob.step, knob.shown(self._request))
        self._changed(slider, lambda value: self._ask(**knob.change(self._request, value)))
        return slider

    def _clicked(self, button: Any, act: Callable[[], Any], slow: bool = False, anybody: bool = False) -> None:
        self._react(button.on_click, lambda _event: act(), slow, anybody)

    def _changed(self, part: Any, act: Callable[[Any], Any], slow: bool = False) -> None:
        self._react(part.on_update, lambda event: act(sound_value(event.target)), slow)

    def _react(self, register: Callable, act: Callable[[Any], Any], slow: bool, anybody: bool = False) -> None:
        """Act for the driver alone; in the order of the messages, or in a thread of its own where it is slow."""

        def allowed(event: Any) -> None:
            try:
                if anybody or self._desk.session.drives(self._me):
                    act(event)
            except S2C2AError as error:
                self._desk.tell(str(error))

        async def in_order(event: Any) -> None:
            allowed(event)

        register(allowed if slow else in_order)
