"""What the arm does as topics of ROS 2."""

import threading
import time
from collections.abc import Callable
from contextlib import suppress

from s2c2a.integrations.ros.messages import DIAGNOSTICS, JOINTS, MARKERS, POSE
from s2c2a.integrations.ros.names import Topic
from s2c2a.integrations.ros.node import Node
from s2c2a.integrations.ros.outputs import Outputs
from s2c2a.live.snapshot import Control, Snapshot

MARKER_INTERVAL = 0.1  # s; a person sees no more, and 30 markers have 10 kB
STATUS_INTERVAL = 1.0  # s; the convention of diagnostics in ROS (REP 107)
STATUS_TOPIC = "/diagnostics"  # by convention, without a namespace (REP 107)


class Reporter:
    """Publishes every snapshot of a control, and its status once a second."""

    def __init__(
        self,
        control: Control,
        outputs: Outputs,
        node: Node,
        namespace: str,
        refused: Callable[[], int],
        log: Callable[[str], None],
    ) -> None:
        """Publish from now on.

        Args:
            control: of the arm.
            outputs: builds the messages.
            node: sends them.
            namespace: of the topics.
            refused: number of refused messages, for the status.
            log: gets the first failure to publish.
        """
        kinds = {
            "joint_states": JOINTS,
            "joint_commands": JOINTS,
            "bends": JOINTS,
            "tip_pose": POSE,
            "markers": MARKERS,
        }
        self._publish = {
            name: node.publisher(Topic(f"{namespace}/{name}", kind))
            for name, kind in kinds.items()
        }
        self._publish_status = node.publisher(Topic(STATUS_TOPIC, DIAGNOSTICS))
        self._control = control
        self._outputs = outputs
        self._refused = refused
        self._log = log
        self._failed = False
        self._next: tuple[Snapshot, float]
        self._arrived = threading.Event()
        self._ended = threading.Event()
        self._marked = self._reported = -float("inf")
        self._unwatch = control.watch(self._take)
        self._thread = threading.Thread(target=self._run, name="outputs", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Publish the last status."""
        with suppress(ValueError):  # closed before
            self._unwatch()
        self._ended.set()
        self._arrived.set()
        self._thread.join()
        self._report(time.time())

    def _take(self, snapshot: Snapshot) -> None:
        self._next = (snapshot, time.time())
        self._arrived.set()

    def _run(self) -> None:
        while not self._ended.is_set():
            if self._arrived.wait(STATUS_INTERVAL) and not self._ended.is_set():
                self._arrived.clear()
                try:
                    self._show(*self._next)
                except (ValueError, IndexError) as error:
                    # an odd sensor of a robot does not end the topics
                    if not self._failed:
                        self._log(f"cannot publish all of the arm's state: {error}")
                    self._failed = True
            if time.monotonic() - self._reported >= STATUS_INTERVAL:
                self._reported = time.monotonic()
                self._report(time.time())

    def _show(self, snapshot: Snapshot, moment: float) -> None:
        step = snapshot.step
        publish = self._publish
        outputs = self._outputs
        if "cables" in step.reading.sensors:
            measured = step.reading.sensors["cables"]
            publish["joint_states"](outputs.cables(measured, moment))
        publish["joint_commands"](outputs.cables(step.action, moment))
        publish["bends"](outputs.bends(snapshot, moment))
        publish["tip_pose"](outputs.tip(snapshot, moment))
        if time.monotonic() - self._marked >= MARKER_INTERVAL:
            self._marked = time.monotonic()
            request = self._control.request
            publish["markers"](outputs.markers(snapshot, request, moment))

    def _report(self, moment: float) -> None:
        request = self._control.request
        values = {
            "driven": request.driven,
            "stopped_by": self._control.halted_by if request.stopped else "",
            "task": request.task or "",
            "refused_messages": self._refused(),
        }
        self._publish_status(self._outputs.status(self._control.latest, values, moment))
