"""One browser's panel: everything to ask with for the driver, a button to take the handle for the others."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import viser
from jaxtyping import Float

from s2c2a.errors import S2C2AError
from s2c2a.live.hints import OBSTACLES, hint_for
from s2c2a.live.recorder import Recorder
from s2c2a.live.session import Session
from s2c2a.live.snapshot import Control
from s2c2a.live.wish import FACTORS, MOST_OBSTACLES, Obstacle, Weights, Wish
from s2c2a.spaces import AXIS, POSITION

DRAG = "drag the target"
NEW_THRESHOLD = 0.1  # of the arm's length
BESIDE = 0.35  # of the arm's length: how far from the tip a new obstacle appears
WEIGHTS = (("position", "target μp"), ("axis", "direction μo"), ("obstacle", "obstacles μob"), ("change", "change μd"))


@dataclass
class View:
    """What is shown beside the arm."""

    ghost: bool = True
    trails: bool = True
    cloud: bool = True


@dataclass(frozen=True)
class Desk:
    """What panels work on.

    Attributes:
        loop: moves the arm.
        session: says who drives.
        recorder: keeps what happens.
        view: what is shown.
        across: the direction to the right on the screen, from where the page begins, base frame.
        tell: says something to one browser, or to all.
    """

    loop: Control
    session: Session
    recorder: Recorder
    view: View
    across: Float[np.ndarray, "3"]
    tell: Callable[[str], None]


class Panel:
    """The panel of one browser; built anew when its part changes."""

    def __init__(self, client: viser.ClientHandle, desk: Desk):
        """An empty panel."""
        self._client, self._gui, self._desk = client, client.gui, desk
        self._role: tuple | None = None

    def refresh(self) -> None:
        """Build what this browser may do now, if that has changed."""
        driver, me = self._desk.session.driver, self._client.client_id
        role = (driver == me, driver is None)
        if role == self._role:
            return
        self._role = role
        self._gui.reset()
        if driver == me:
            self._build_driver()
        else:
            self._build_watcher(free=driver is None)

    def _build_watcher(self, free: bool) -> None:
        take = self._gui.add_button(
            "Take the handle" if free else "Somebody else drives",
            disabled=not free,
            color="blue",
            icon=viser.Icon.HAND_GRAB,
            order=10,
        )

        @take.on_click
        async def _(_event) -> None:
            self._desk.session.take(self._client.client_id)

    def _build_driver(self) -> None:
        self._build_stop()
        tabs = self._gui.add_tab_group(order=11)
        for label, build in (
            ("Task", self._build_task),
            ("Avoid", self._build_obstacles),
            ("Plan", self._build_planner),
            ("Faults", self._build_trouble),
            ("More", self._build_more),
        ):
            with tabs.add_tab(label):
                build()

    def _build_stop(self) -> None:
        stopped = self._wish.stopped
        stop = self._button("Go on" if stopped else "Stop", color="green" if stopped else "red", order=-1)

        def toggle() -> None:
            now = not self._wish.stopped
            self._ask(stopped=now)
            stop.label, stop.color = ("Go on", "green") if now else ("Stop", "red")

        self._clicked(stop, toggle)

    def _build_task(self) -> None:
        wish, loop = self._wish, self._desk.loop
        hint = self._gui.add_markdown(hint_for(wish.task))
        names = (DRAG, *loop.limits.tasks)
        task = self._gui.add_dropdown("Task", names, initial_value=wish.task or DRAG)
        play = self._button("Pause" if wish.playing else "Play", visible=bool(wish.task))
        step = self._button("One step", visible=bool(wish.task))
        again = self._button("From the start", visible=bool(wish.task))
        speed = self._gui.add_slider("Speed", 0.25, 3.0, 0.25, wish.speed, visible=bool(wish.task))
        pointed = self._gui.add_checkbox("A direction too", wish.axis is not None, visible=not wish.task)
        here = self._button("Target to the tip", visible=not wish.task)

        def choose(name: str) -> None:
            chosen = None if name == DRAG else name
            self._ask(task=chosen, playing=chosen is not None)
            play.label, hint.content = "Pause" if chosen else "Play", hint_for(chosen)
            play.visible = step.visible = again.visible = speed.visible = chosen is not None
            pointed.visible = here.visible = chosen is None
            if chosen is None:
                self._target_to_tip()

        def toggle() -> None:
            self._ask(playing=not self._wish.playing)
            play.label = "Pause" if self._wish.playing else "Play"

        self._changed(task, choose)
        self._clicked(play, toggle)
        self._clicked(step, loop.step_task)
        self._clicked(again, loop.restart_task)
        self._changed(speed, lambda value: self._ask(speed=value))
        self._changed(pointed, lambda on: self._ask(axis=self._tip_axis() if on else None))
        self._clicked(here, self._target_to_tip)

    def _build_obstacles(self) -> None:
        self._gui.add_markdown(OBSTACLES)
        add, remove = self._button("Add one"), self._button("Remove the last")
        threshold = self._gui.add_slider(
            "Threshold r [cm]", 1.0, 20.0, 0.5, round(100 * NEW_THRESHOLD * self._desk.loop.arm.length, 1)
        )

        def put() -> None:
            own = self._wish.obstacles
            if len(own) >= MOST_OBSTACLES:
                return self._desk.tell(f"{MOST_OBSTACLES} obstacles are the most")
            self._ask(obstacles=(*own, Obstacle(self._beside_tip(len(own)), float(threshold.value) / 100)))

        def resize(value: float) -> None:
            own = self._wish.obstacles
            if own:
                self._ask(obstacles=(*own[:-1], replace(own[-1], threshold=value / 100)))

        self._clicked(add, put)
        self._clicked(remove, lambda: self._ask(obstacles=self._wish.obstacles[:-1]))
        self._changed(threshold, resize)

    def _build_planner(self) -> None:
        names = self._desk.loop.strategies
        latest = self._desk.loop.latest
        chosen = self._gui.add_dropdown(
            "Driven by", names, initial_value=latest.strategy if latest and latest.strategy in names else names[0]
        )
        self._gui.add_markdown("How much each wish weighs, times what it does:")
        weights = self._wish.weights
        for name, label in WEIGHTS:
            slider = self._gui.add_slider(label, FACTORS[0], 4.0, 0.1, getattr(weights, name))
            self._changed(slider, partial(self._weigh, name))

        def change(name: str) -> None:
            self._desk.tell(f"{name}: preparing …")
            self._desk.loop.use(name)
            self._desk.tell(f"{name} drives")

        self._changed(chosen, change, slow=True)

    def _build_trouble(self) -> None:
        wish, limits = self._wish, self._desk.loop.limits
        payload = self._gui.add_slider("Payload [g]", 0.0, 1000 * limits.payload, 5.0, 1000 * wish.payload)
        pushes = [
            self._gui.add_slider(f"Push {name} [N]", -limits.push, limits.push, limits.push / 20, wish.push[place])
            for place, name in enumerate("xyz")
        ]
        noise = self._gui.add_slider("Sensor noise [%]", 0.0, 100 * limits.noise, 0.1, 100 * wish.noise)
        coupling = self._gui.add_slider(
            "Sensor coupling [%]", 0.0, 100.0, 5.0, 100 * wish.coupling, visible=self._desk.loop.arm.module_count == 3
        )
        calm = self._button("No faults")

        def clear() -> None:
            self._ask(payload=0.0, push=(0.0, 0.0, 0.0), noise=0.0, coupling=0.0)
            sliders: list[viser.GuiSliderHandle[float]] = [payload, *pushes, noise, coupling]
            for slider in sliders:
                slider.value = 0.0  # type: ignore[misc] # viser hides the setter from type checkers

        self._changed(payload, lambda value: self._ask(payload=value / 1000))
        for place, slider in enumerate(pushes):
            self._changed(slider, partial(self._push, place))
        self._changed(noise, lambda value: self._ask(noise=value / 100))
        self._changed(coupling, lambda value: self._ask(coupling=value / 100))
        self._clicked(calm, clear)

    def _build_more(self) -> None:
        recorder, view = self._desk.recorder, self._desk.view
        record = self._button("Stop recording" if recorder.running else "Record")
        reset, give = self._button("Reset the arm"), self._button("Let others drive")
        for label, name in (("Planned arm", "ghost"), ("Trails", "trails"), ("Workspace", "cloud")):
            box = self._gui.add_checkbox(label, getattr(view, name))
            self._changed(box, partial(setattr, view, name))

        def toggle() -> None:
            if not recorder.running:
                recorder.start()
                record.label = "Stop recording"
                return
            record.label = "Record"
            folder = recorder.stop()
            self._desk.tell(f"written; look at it with: s2c2a view {folder}" if folder else "too short to keep")

        self._clicked(record, toggle, slow=True)
        self._clicked(reset, self._desk.loop.reset)
        self._clicked(give, lambda: self._desk.session.give(self._client.client_id))

    @property
    def _wish(self) -> Wish:
        return self._desk.loop.wish

    def _ask(self, **changes: Any) -> None:
        self._desk.loop.ask(**changes)

    def _weigh(self, name: str, value: float) -> None:
        self._ask(weights=Weights(**{**vars(self._wish.weights), name: value}))

    def _push(self, place: int, value: float) -> None:
        force = list(self._wish.push)
        force[place] = value
        self._ask(push=tuple(force))

    def _target_to_tip(self) -> None:
        latest = self._desk.loop.latest
        if latest is not None:
            self._ask(target=tuple(latest.states[-1, POSITION]), axis=None)

    def _tip_axis(self):
        latest = self._desk.loop.latest
        return (0.0, 0.0, 1.0) if latest is None else tuple(latest.states[-1, AXIS])

    def _beside_tip(self, number: int):
        """Clear of the tip, as far from whoever looks from where the page begins, each on another side."""
        latest, size = self._desk.loop.latest, self._desk.loop.arm.length
        tip = np.zeros(3) if latest is None else latest.states[-1, POSITION]
        away = BESIDE * size * (1 + number // 2) * (-1) ** number
        return tuple(tip + away * self._desk.across)

    def _button(self, label: str, **options: Any) -> viser.GuiButtonHandle:
        return self._gui.add_button(label, **({"color": "gray"} | options))

    def _clicked(self, button: viser.GuiButtonHandle, act: Callable[[], Any], slow: bool = False) -> None:
        self._react(button.on_click, lambda _event: act(), slow)

    def _changed(self, part: Any, act: Callable[[Any], Any], slow: bool = False) -> None:
        self._react(part.on_update, lambda event: act(event.target.value), slow)

    def _react(self, register: Callable, act: Callable[[Any], Any], slow: bool) -> None:
        """Act for the driver alone; in the order of the messages, or in a thread of its own where it is slow."""

        def allowed(event: Any) -> None:
            if not self._desk.session.drives(self._client.client_id):
                return
            try:
                act(event)
            except S2C2AError as error:
                self._desk.tell(str(error))

        async def in_order(event: Any) -> None:
            allowed(event)

        register(allowed if slow else in_order)
