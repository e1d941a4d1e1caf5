"""Showing of control steps in a thread, so that no viewer delays a step."""

import math
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from queue import Full, Queue
from threading import Thread

from s2c2a.arm import ArmSpec
from s2c2a.evaluation.rollout import OnStep
from s2c2a.integrations.scenes import StepScene, scene_of
from s2c2a.runtime import StepRecord

MAX_WAITING = 100  # steps; 10 s of most arms, then further ones are left out
PATIENCE = 5.0  # s; at the end, for the steps that wait

Show = Callable[[StepScene], None]


@contextmanager
def shown_in_background(arm: ArmSpec, show: Show) -> Iterator[OnStep]:
    """Yield a function that hands a step to a thread, and returns at once.

    Steps are left out while the thread is behind. An error of the viewer is a warning,
    and the run goes on without it.

    Args:
        arm: that is controlled.
        show: called in the thread with every scene; its times rise also from run to run.
    """
    waiting = Queue[StepRecord | None](MAX_WAITING)

    def on_step(record: StepRecord) -> None:
        with suppress(Full):
            waiting.put_nowait(record)

    thread = Thread(target=_show_all, args=(arm, waiting, show), daemon=True)
    thread.start()
    try:
        yield on_step
    finally:
        with suppress(Full):
            waiting.put(None, timeout=PATIENCE)
        thread.join(PATIENCE)


def _show_all(arm: ArmSpec, waiting: Queue[StepRecord | None], show: Show) -> None:
    """Show steps until None, or an error of the viewer."""
    start = 0.0
    end = -math.inf
    while (record := waiting.get()) is not None:
        time = record.reading.time
        if not math.isfinite(time):
            continue
        if start + time <= end:  # another run begins
            start = end + arm.control_period
        end = start + time
        try:
            show(scene_of(record, arm, end))
        except Exception as error:  # of a viewer: no reason to stop an arm
            warnings.warn(
                f"the run is not shown any more: {type(error).__name__}: {error}",
                stacklevel=1,
            )
            return
