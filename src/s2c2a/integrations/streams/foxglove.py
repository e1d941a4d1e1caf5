"""Runs in Foxglove, through a WebSocket server on this machine."""

import time
from collections.abc import Iterator
from contextlib import contextmanager

from s2c2a.arm import ArmSpec
from s2c2a.errors import S2C2AError
from s2c2a.evaluation.rollout import OnStep
from s2c2a.integrations.extras import needs_extra
from s2c2a.integrations.scenes import StepScene
from s2c2a.integrations.streams.background import shown_in_background

with needs_extra("foxglove", "--stream foxglove"):
    import foxglove

    from s2c2a.integrations.foxglove_scene import NANOSECONDS, FoxgloveScene

HOST = "127.0.0.1"
"""The server has no password: only this machine sees the arm."""
PORT = 8765  # that which Foxglove offers


@contextmanager
def foxglove_stream(arm: ArmSpec, port: int = PORT) -> Iterator[OnStep]:
    """Serve steps to Foxglove while the arm is controlled.

    Args:
        arm: that is controlled.
        port: of the server on 127.0.0.1; 0 for any that is free.

    Raises:
        S2C2AError: the port is not free.
    """
    context = foxglove.Context()
    try:
        server = foxglove.start_server(
            name="s2c2a", host=HOST, port=port, context=context
        )
    except (OverflowError, RuntimeError, OSError) as error:
        raise S2C2AError(
            f"Foxglove cannot be served on port {port}: {error}; choose another one: "
            "--stream foxglove,port=8766"
        ) from error
    print(f"stream: Foxglove, ws://{HOST}:{server.port}")
    channels = FoxgloveScene(arm, context)
    start = time.time_ns()

    def show(scene: StepScene) -> None:
        channels.log(scene, start + round(scene.time * NANOSECONDS))

    try:
        with shown_in_background(arm, show) as on_step:
            yield on_step
    finally:
        server.stop()
