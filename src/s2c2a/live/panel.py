"""One browser's panel: everything to ask with for the driver, a button to take the handle for the others.

Stop is not here: the gate gives one to everybody who looks at the page.
"""

import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import Any, cast

from viser import ClientHandle, GuiButtonHandle, GuiSliderHandle, Icon

from s2c2a.errors import S2C2AError
from s2c2a.live.recorder import Recorder
from s2c2a.live.request import (
    MAX_OBSTACLES,
    SPEED,
    WEIGHTS,
    Knob,
    Obstacle,
    Request,
    faults,
    point,
)
from s2c2a.live.session import Session
from s2c2a.live.snapshot import Control, Snapshot
from s2c2a.live.window import across_the_screen, sound_value
from s2c2a.spaces import AXIS, POSITION

DRAG = "drag the target"
NEW_THRESHOLD = 0.1  # of the arm's length
BESIDE = 0.35  # of the arm's length: how far from the tip a new obstacle appears
COUPLED = 3  # modules of the paper's arm, whose sensors leak
OBSTACLES = "Drag an obstacle: the arm gives way. It moves in the plane of the screen; turn the view for another."
YOU_DRIVE = "You drive. Drag the violet ball: the arm follows."
HINTS = {
    "circle": ": its tip goes round in a circle",
    "tilt": ": a circle again, and the tip points as far from the vertical as the name says",
    "hold": ": the tip stays, and a module's end does what the name says",
    "reach": ": to a point, with so many obstacles on the way",
    "risk": ": to a point beside an obstacle, more or less near",
    "flee": ": an obstacle comes nearer",
    "follow": ": a target wanders about",
}


class Panel:
    """The panel of one browser; built anew when its part changes."""

    def __init__(
        self,
        client: ClientHandle,
        control: Control,
        session: Session,
        recorder: Recorder,
        tell: Callable[[str], None],
    ):
        """An empty panel.

        Args:
            client: the browser.
            control: moves the arm.
            session: says who drives.
            recorder: keeps what happens.
            tell: says something to all browsers.
        """
        self._me = client.client_id
        self._gui = client.gui
        self._control = control
        self._session = session
        self._recorder = recorder
        self._tell = tell
        self._role: tuple | None = None
        self._building = threading.Lock()
        self._followers: list[Callable[[Request], None]] = []

    def refresh(self) -> None:
        """Build what this browser may do now, if that has changed."""
        driver = self._session.driver
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
        request = self._control.request
        # parts of a browser that goes at this moment
        with self._building, suppress(RuntimeError):
            for follower in self._followers:
                follower(request)

    def _build_watcher(self, free: bool) -> None:
        label = "Take the handle" if free else "Somebody else drives"
        take = self._gui.add_button(
            label, disabled=not free, color="blue", icon=Icon.HAND_GRAB, order=10
        )
        self._react(take.on_click, lambda _: self._session.take(self._me), anybody=True)

    def _build_driver(self) -> None:
        go_on = self._button(
            "Go on", lambda: self._control.ask(stopped=False), color="green", order=-1
        )
        self._followers.append(
            lambda request: setattr(go_on, "visible", request.stopped)
        )
        tabs = {
            "Task": self._build_task,
            "Avoid": self._build_obstacles,
            "Plan": self._build_planner,
        }
        tabs |= {"Faults": self._build_faults, "More": self._build_more}
        group = self._gui.add_tab_group(order=11)
        for label, build in tabs.items():
            with group.add_tab(label):
                build()

    def _build_task(self) -> None:
        control = self._control
        gui = self._gui
        hint = gui.add_markdown("")
        task = gui.add_dropdown(
            "Task",
            (DRAG, *control.limits.tasks),
            initial_value=control.request.task or DRAG,
        )
        play = self._button("Play", self._play)
        of_task: list[Any] = [play, self._button("One step", control.step_task)]
        of_task += [
            self._button("From the start", control.restart_task),
            self._slider(SPEED),
        ]
        pointed = gui.add_checkbox("A direction too", control.request.axis is not None)
        of_drag = [pointed, self._button("Target to the tip", self._target_to_tip)]

        def follow(request: Request) -> None:
            kind = next(
                (
                    said
                    for start, said in HINTS.items()
                    if (request.task or "").startswith(start)
                ),
                "",
            )
            asked = (
                f"*{request.task}*{kind}. The arm goes to its start; Play begins it."
            )
            hint.content = YOU_DRIVE if request.task is None else asked
            play.label = (
                "Pause" if request.playing and not self._latest.finished else "Play"
            )
            for part in (*of_task, *of_drag):
                part.visible = (request.task is not None) == (part in of_task)

        self._followers.append(follow)
        self._changed(task, self._choose)
        self._changed(
            pointed,
            lambda on: control.ask(
                axis=tuple(self._latest.states[-1, AXIS]) if on else None
            ),
        )

    def _choose(self, name: str) -> None:
        self._control.ask(task=None if name == DRAG else name, playing=False)
        if name == DRAG:
            self._target_to_tip()

    def _play(self) -> None:
        over = self._latest.finished
        if over:
            self._control.restart_task()
        self._control.ask(playing=over or not self._control.request.playing)

    def _build_obstacles(self) -> None:
        control = self._control
        size = self._control.arm.length
        self._gui.add_markdown(OBSTACLES)
        first = round(min(100 * NEW_THRESHOLD * size, 20.0), 1)

        def put() -> None:
            """Clear of the tip, as far from whoever looks from where the page begins, each on another side."""
            own = control.request.obstacles
            if len(own) >= MAX_OBSTACLES:
                return self._tell(f"{MAX_OBSTACLES} obstacles are the most")
            away = BESIDE * size * (1 + len(own) // 2) * (-1) ** len(own)
            place = point(
                self._latest.states[-1, POSITION]
                + away * across_the_screen(control.arm)
            )
            control.ask(obstacles=(*own, Obstacle(place, sound_value(threshold) / 100)))

        def resize(value: float) -> None:
            own = control.request.obstacles
            control.ask(
                obstacles=(
                    *own[:-1],
                    *(replace(one, threshold=value / 100) for one in own[-1:]),
                )
            )

        self._button("Add one", put)
        self._button(
            "Remove the last",
            lambda: control.ask(obstacles=control.request.obstacles[:-1]),
        )
        threshold = self._gui.add_slider(
            "Threshold r [cm]", min(first, 1.0), 20.0, 0.1, first
        )
        self._changed(threshold, resize)

    def _build_planner(self) -> None:
        names = self._control.strategies
        now = self._latest.strategy
        chosen = self._gui.add_dropdown(
            "Driven by", names, initial_value=now if now in names else names[0]
        )
        self._gui.add_markdown("How much each request weighs, times what it does:")
        for knob in WEIGHTS:
            self._slider(knob)

        def change(name: str) -> None:
            self._tell(f"{name}: preparing …")
            self._control.use(name)
            self._tell(f"{name} drives")

        self._changed(chosen, change, slow=True)

    def _build_faults(self) -> None:
        knobs = faults(self._control.limits, self._control.arm.module_count == COUPLED)
        sliders = [self._slider(knob) for knob in knobs if knob.high > knob.low]

        def clear() -> None:
            self._control.ask(
                payload=0.0, push=(0.0, 0.0, 0.0), noise=0.0, coupling=0.0
            )
            for slider in sliders:
                slider.value = 0.0  # type: ignore[misc] # viser hides the setter from type checkers

        self._button("No faults", clear)

    def _build_more(self) -> None:
        recorder = self._recorder
        view = self._session.view
        record = self._button("Record", self._record, slow=True)
        self._followers.append(
            lambda _: setattr(
                record, "label", "Stop recording" if recorder.running else "Record"
            )
        )
        self._button("Reset the arm", self._control.reset)
        self._button("Let others drive", lambda: self._session.give(self._me))
        for label, shown in view.items():
            self._changed(
                self._gui.add_checkbox(label, shown), partial(view.__setitem__, label)
            )
        margins = self._gui.add_markdown("")

        def follow(_: Request) -> None:
            said = self._latest.margins
            margins.content = f"Margins of the loop: {said}." if said else ""

        self._followers.append(follow)

    def _record(self) -> None:
        if not self._recorder.running:
            return self._recorder.start()
        folder = self._recorder.stop()
        self._tell(
            f"written; look at it with: s2c2a view {folder}"
            if folder
            else "too short to keep"
        )

    @property
    def _latest(self) -> Snapshot:
        """Nobody has a panel before the arm has moved."""
        return cast(Snapshot, self._control.latest)

    def _target_to_tip(self) -> None:
        self._control.ask(target=tuple(self._latest.states[-1, POSITION]), axis=None)

    def _button(
        self, label: str, act: Callable[[], Any], slow: bool = False, **looks: Any
    ) -> GuiButtonHandle:
        button = self._gui.add_button(label, **({"color": "gray"} | looks))
        self._react(button.on_click, lambda _: act(), slow)
        return button

    def _slider(self, knob: Knob) -> GuiSliderHandle:
        slider = self._gui.add_slider(
            knob.label,
            knob.low,
            knob.high,
            knob.step,
            knob.shown(self._control.request),
        )
        self._changed(
            slider,
            lambda value: self._control.ask(
                **knob.change(self._control.request, value)
            ),
        )
        return slider

    def _changed(
        self, part: Any, act: Callable[[Any], Any], slow: bool = False
    ) -> None:
        self._react(part.on_update, lambda event: act(sound_value(event.target)), slow)

    def _react(
        self,
        register: Callable,
        act: Callable,
        slow: bool = False,
        anybody: bool = False,
    ) -> None:
        """Act for the driver alone; in the order of the messages, or in a thread of its own where it is slow."""

        def allowed(event: Any) -> None:
            try:
                if anybody or self._session.drives(self._me):
                    act(event)
            except S2C2AError as error:
                self._tell(str(error))

        async def in_order(event: Any) -> None:
            allowed(event)

        register(allowed if slow else in_order)
