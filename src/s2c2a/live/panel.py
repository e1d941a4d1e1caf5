"""Control panel of one browser: all inputs for the driver, a button for the others.

The Stop button is not part of the panel: the gate adds it to the page for everybody.
"""

import secrets
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from datetime import datetime
from functools import partial
from typing import Any, cast

import numpy as np
from viser import (
    ClientHandle,
    GuiButtonHandle,
    GuiEvent,
    GuiSliderHandle,
    GuiVector3Handle,
    Icon,
)

from s2c2a.errors import S2C2AError
from s2c2a.live.browsers import Browsers
from s2c2a.live.recorder import Recorder
from s2c2a.live.request import (
    MAX_OBSTACLES,
    SPEED_SLIDER,
    WEIGHT_SLIDERS,
    Obstacle,
    Point,
    Request,
    RequestSlider,
    fault_sliders,
    point,
)
from s2c2a.live.scene_files import save_scene, solid_of
from s2c2a.live.snapshot import Control, Snapshot
from s2c2a.live.window import across_the_screen, checked_value
from s2c2a.spaces import AXIS, POSITION
from s2c2a.tasks.scenes import SOLID, AnySolid, Scene

DRAG = "drag the target"
NEW_THRESHOLD = 0.1  # in arm lengths
NEW_DISTANCE = 0.35  # in arm lengths; distance of a new obstacle from the tip
COUPLED_MODULES = 3  # modules of the paper's arm, whose sensors are coupled
SHAPE = "Set the whole shape"
DRAG_HINT = (
    "You drive. Drag the violet ball: the arm follows. Keys move it, too: W A S D or "
    "arrows level, R and F up and down; a gamepad by its sticks."
)
OBSTACLE_HINT = (
    "Drag an obstacle: the arm avoids it. It moves in the plane of the screen; "
    "turn the view to move it in another plane."
)
TASK_HINTS = {
    "circle": ": the tip follows a circle",
    "tilt": ": the tip follows a circle, tilted from the vertical by the angle in the name",
    "hold": ": the tip stays, and the end of a named module moves",
    "reach": ": the tip reaches a point past as many obstacles",
    "risk": ": the tip reaches a point near an obstacle",
    "flee": ": an obstacle approaches the arm",
    "follow": ": the tip follows a wandering target",
}
KINDS = "sphere", "box", "capsule", "cylinder", "half_space"


class Panel:
    """Panel of one browser, rebuilt when the browser becomes driver or watcher.

    Attributes:
        steering_key: which the page of the browser that drives holds; no other page
            knows it.
    """

    def __init__(
        self,
        client: ClientHandle,
        control: Control,
        browsers: Browsers,
        recorder: Recorder,
        notify: Callable[[str], None],
    ):
        """Create an empty panel.

        Args:
            client: the browser.
            control: moves the arm.
            browsers: which browser drives.
            recorder: of the page.
            notify: shows a message in all browsers.
        """
        self.steering_key = secrets.token_hex(16)
        self._client = client.client_id
        self._gui = client.gui
        self._control = control
        self._browsers = browsers
        self._recorder = recorder
        self._notify = notify
        self._role: tuple | None = None
        self._building = threading.Lock()
        self._followers: list[Callable[[Request], None]] = []

    def refresh(self) -> None:
        """Rebuild the panel if the role of this browser changed."""
        driver = self._browsers.driver
        role = (driver == self._client, driver is None)
        with self._building:
            if role == self._role:
                return
            self._role = role
            self._followers.clear()
            self._gui.reset()
            if driver == self._client:
                self._build_driver()
            else:
                free = driver is None
                label = "Take control" if free else "Another browser drives"
                button = self._gui.add_button(
                    label,
                    disabled=not free,
                    color="blue",
                    icon=Icon.HAND_GRAB,
                    order=10,
                )

                @button.on_click
                async def _(_event: GuiEvent) -> None:
                    self._browsers.take(self._client)

        self.follow()

    def follow(self) -> None:
        """Update labels and visibility to the current request."""
        request = self._control.request
        # a browser that disconnects now raises a RuntimeError
        with self._building, suppress(RuntimeError):
            for follower in self._followers:
                follower(request)

    def _build_driver(self) -> None:
        resume = self._button(
            "Resume", lambda: self._control.ask(stopped=False), color="green", order=-1
        )

        def follow(request: Request) -> None:
            resume.visible = request.stopped

        self._followers.append(follow)
        self._build_steering()
        tabs = {
            "Task": self._build_task,
            "Avoid": self._build_obstacles,
            "Plan": self._build_planner,
            "Faults": self._build_faults,
            "More": self._build_more,
        }
        group = self._gui.add_tab_group(order=11)
        for label, build in tabs.items():
            with group.add_tab(label):
                build()

    def _build_steering(self) -> None:
        """Give the page its key while the target, and no task, is followed."""
        holder = self._gui.add_html("", order=-2)

        def follow(request: Request) -> None:
            key = f'<span data-s2c2a-steering="{self.steering_key}"></span>'
            content = key if request.task is None else ""
            if holder.content != content:
                holder.content = content

        self._followers.append(follow)

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
        task_elements: list[Any] = [
            play,
            self._button("Single step", control.step_task),
            self._button("Restart", control.restart_task),
            self._slider(SPEED_SLIDER),
        ]
        direction = gui.add_checkbox("Set direction", control.request.axis is not None)
        shape = gui.add_checkbox(SHAPE, control.request.shape is not None)
        drag_elements: list[Any] = [
            direction,
            *[shape] * (control.arm.module_count > 1),
            self._button("Move target to tip", self._target_to_tip),
        ]

        def follow(request: Request) -> None:
            hint.content = DRAG_HINT
            if request.task is not None:
                hint.content = _task_hint(request.task)
            playing = request.playing and not self._latest.finished
            play.label = "Pause" if playing else "Play"
            for element in task_elements:
                element.visible = request.task is not None
            for element in drag_elements:
                element.visible = request.task is None
            direction.value &= request.axis is not None  # type: ignore[misc] # viser hides it
            shape.value &= request.shape is not None  # type: ignore[misc] # viser hides it

        def set_direction(checked: bool) -> None:
            axis = tuple(self._latest.states[-1, AXIS]) if checked else None
            control.ask(axis=axis)

        def set_shape(checked: bool) -> None:
            ends = self._latest.states[:-1, POSITION]
            control.ask(shape=ends if checked else None)

        self._followers.append(follow)
        drag_elements.append(self._build_target_field())
        self._on_change(shape, set_shape)
        self._on_change(task, self._choose_task)
        self._on_change(direction, set_direction)

    def _build_target_field(self) -> GuiButtonHandle:
        """Coordinates of the target, and the button that sets them, returned."""
        control = self._control
        field = self._point_field(
            "Target [cm]",
            lambda request: request.target if request.task is None else None,
        )

        def set_target() -> None:
            if target := control.request.target:
                control.ask(target=_edited(field, target))

        return self._button("Set target", set_target)

    def _choose_task(self, name: str) -> None:
        self._control.ask(task=None if name == DRAG else name, playing=False)
        if name == DRAG:
            self._target_to_tip()

    def _play(self) -> None:
        """Pause or continue the task; start again after its end."""
        finished = self._latest.finished
        if finished:
            self._control.restart_task()
        self._control.ask(playing=finished or not self._control.request.playing)

    def _build_obstacles(self) -> None:
        control = self._control
        size = self._control.arm.length
        self._gui.add_markdown(OBSTACLE_HINT)
        first = round(min(100 * NEW_THRESHOLD * size, 20.0), 1)

        def add() -> None:
            """Add an obstacle beside the tip, alternately to its right and left."""
            obstacles = control.request.obstacles
            count = len(obstacles)
            if count >= MAX_OBSTACLES:
                return self._notify(f"no more than {MAX_OBSTACLES} obstacles")
            distance = NEW_DISTANCE * size * (1 + count // 2) * (-1) ** count
            offset = distance * across_the_screen(control.arm)
            center = self._latest.tip + offset
            solid = _new_solid(
                kind.value, center, checked_value(threshold) / 100, offset
            )
            control.ask(obstacles=(*obstacles, Obstacle.of(solid.rows()[0])))

        def remove() -> None:
            control.ask(obstacles=control.request.obstacles[:-1])

        def resize(value: float) -> None:
            obstacles = list(control.request.obstacles)
            if obstacles:
                obstacles[-1] = replace(obstacles[-1], threshold=value / 100)
            control.ask(obstacles=tuple(obstacles))

        def save() -> None:
            solids = [solid_of(obstacle.row) for obstacle in control.request.obstacles]
            name = f"scene-{datetime.now():%Y%m%d-%H%M%S}.toml"
            path = self._recorder.folder / name
            try:
                path.parent.mkdir(parents=True, exist_ok=True)
                save_scene(Scene(obstacles=tuple(solids)), path)
            except (S2C2AError, OSError) as error:
                return self._notify(str(error))
            self._notify(f"saved {path}: use it with --scene")

        kind = self._gui.add_dropdown("Kind", KINDS)
        self._button("Add obstacle", add)
        self._button("Remove last obstacle", remove)
        self._button("Save obstacles as a scene", save)
        threshold = self._gui.add_slider(
            "Threshold r [cm]", min(first, 1.0), 20.0, 0.1, first
        )
        self._on_change(threshold, resize)

        self._build_obstacle_fields()

    def _build_obstacle_fields(self) -> None:
        """Coordinates of every obstacle, and one button that sets them."""
        control = self._control

        def center(number: int, request: Request) -> Point | None:
            obstacles = request.obstacles
            return obstacles[number].place if number < len(obstacles) else None

        fields = [
            self._point_field(f"Obstacle {number + 1} [cm]", partial(center, number))
            for number in range(MAX_OBSTACLES)
        ]

        def set_obstacles() -> None:
            obstacles = control.request.obstacles
            moved = [
                obstacle.at(_edited(field, obstacle.place))
                for field, obstacle in zip(fields, obstacles, strict=False)
            ]
            control.ask(obstacles=tuple(moved))

        button = self._button("Set obstacles", set_obstacles)

        def follow(request: Request) -> None:
            button.visible = bool(request.obstacles)

        self._followers.append(follow)

    def _point_field(
        self, label: str, read: Callable[[Request], Point | None]
    ) -> GuiVector3Handle:
        """Coordinates of a point of the request [cm] to edit; hidden without a point.

        A button sets them, since the arm would move for every digit that is typed.
        """
        field = self._gui.add_vector3(label, (0.0, 0.0, 0.0), step=0.1)
        shown: Point | None = None

        def follow(request: Request) -> None:
            nonlocal shown
            place = read(request)
            field.visible = place is not None
            # what was typed stays until the point moves
            if place is not None and place != shown:
                field.value = _centimeters(place)  # type: ignore[misc] # viser hides it
            shown = place

        self._followers.append(follow)
        return field

    def _build_planner(self) -> None:
        names = self._control.strategies
        current = self._latest.strategy
        dropdown = self._gui.add_dropdown(
            "Strategy", names, initial_value=current if current in names else names[0]
        )
        self._gui.add_markdown("Factors of the cost weights:")
        for slider in WEIGHT_SLIDERS:
            self._slider(slider)

        def change(name: str) -> None:
            self._notify(f"loading {name} …")
            self._control.use(name)
            self._notify(f"strategy: {name}")

        self._on_change(dropdown, change, slow=True)

    def _build_faults(self) -> None:
        coupled = self._control.arm.module_count == COUPLED_MODULES
        faults = fault_sliders(self._control.limits, coupled)
        sliders = [self._slider(fault) for fault in faults if fault.high > fault.low]

        def clear() -> None:
            self._control.ask(
                payload=0.0, force=(0.0, 0.0, 0.0), noise=0.0, coupling=0.0
            )
            for slider in sliders:
                slider.value = 0.0  # type: ignore[misc] # viser hides the setter

        self._button("Clear all faults", clear)

    def _build_more(self) -> None:
        recorder = self._recorder
        view = self._browsers.view
        record = self._button("Record", self._record, slow=True)
        self._button("Reset arm", self._control.reset)
        self._button("Let others drive", lambda: self._browsers.release(self._client))
        for label, visible in view.items():
            checkbox = self._gui.add_checkbox(label, visible)
            self._on_change(checkbox, partial(view.__setitem__, label))

        def follow(_: Request) -> None:
            label = "Stop recording" if recorder.running else "Record"
            record.label = "Recording failed: why?" if recorder.error else label

        self._followers.append(follow)

    def _record(self) -> None:
        if not self._recorder.running:
            return self._recorder.start()
        folder = self._recorder.stop()
        if folder is None:
            return self._notify("not saved: the recording is too short")
        self._notify(f"recording saved; view it with: s2c2a view {folder}")

    @property
    def _latest(self) -> Snapshot:
        """The latest snapshot, which exists before any panel does."""
        return cast(Snapshot, self._control.latest)

    def _target_to_tip(self) -> None:
        self._control.ask(target=self._latest.tip, axis=None)

    def _button(
        self,
        label: str,
        action: Callable[[], Any],
        slow: bool = False,
        color: Any = "gray",
        order: float | None = None,
    ) -> GuiButtonHandle:
        button = self._gui.add_button(label, color=color, order=order)
        self._react(button.on_click, lambda _: action(), slow)
        return button

    def _slider(self, slider: RequestSlider) -> GuiSliderHandle:
        control = self._control
        handle = self._gui.add_slider(
            slider.label,
            slider.low,
            slider.high,
            slider.step,
            slider.value(control.request),
        )

        def change(value: float) -> None:
            control.ask(**slider.change(control.request, value))

        self._on_change(handle, change)
        return handle

    def _on_change(
        self, element: Any, action: Callable[[Any], Any], slow: bool = False
    ) -> None:
        self._react(
            element.on_update, lambda event: action(checked_value(event.target)), slow
        )

    def _react(self, register: Callable, action: Callable, slow: bool = False) -> None:
        """Register an action of the driver.

        Actions run in the order of the messages; `slow` ones in separate threads.
        """

        def act(event: Any) -> None:
            try:
                if self._browsers.drives(self._client):
                    action(event)
            except S2C2AError as error:
                self._notify(str(error))

        async def act_in_order(event: Any) -> None:
            act(event)

        register(act if slow else act_in_order)


def _centimeters(place: Point) -> Point:
    """A point [m] as it is shown [cm]."""
    return point(round(100 * coordinate, 1) for coordinate in place)


def _edited(field: GuiVector3Handle, place: Point) -> Point:
    """The point of a field [m]; the present one, which is not rounded, if unedited."""
    typed = checked_value(field)
    return place if typed == _centimeters(place) else point(np.divide(typed, 100))


def _task_hint(task: str) -> str:
    hint = ""
    for start, text in TASK_HINTS.items():
        if task.startswith(start):
            hint = text
    return f"*{task}*{hint}. The arm goes to the start; press Play to begin."


def _new_solid(
    kind: str, center: np.ndarray, size: float, offset: np.ndarray
) -> AnySolid:
    """An obstacle to add.

    Args:
        kind: of a scene file.
        center: where it stands [m]; for a wall, a point of its surface.
        size: its radius, half its edges, or a quarter of its length [m].
        offset: from the tip to the center; a wall faces the tip.
    """
    axis = np.array([0.0, 0.0, 2.0 * size])
    along = {"start": center - axis, "end": center + axis, "radius": size}
    keys: dict[str, dict[str, Any]] = {
        "sphere": {"center": center, "radius": size},
        "box": {"center": center, "size": np.full(3, 2.0 * size)},
        "capsule": along,
        "cylinder": along,
        "half_space": {"point": center, "normal": -offset},
    }
    given = keys[kind].items()
    values = {name: np.asarray(value).tolist() for name, value in given}
    return SOLID.validate_python({"kind": kind, **values})
