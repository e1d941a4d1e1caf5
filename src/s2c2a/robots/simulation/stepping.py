"""MuJoCo, many physics steps at a time, and one state taken over by another model."""

import mujoco
import numpy as np
from jaxtyping import Float
from mujoco.rollout import Rollout

_PHYSICS = mujoco.mjtState.mjSTATE_FULLPHYSICS


def stepped(
    rollout: Rollout,
    model: mujoco.MjModel,
    data: mujoco.MjData,
    commands: Float[np.ndarray, "times cables"],
    wrenches: Float[np.ndarray, "bodies 6"] | None,
) -> Float[np.ndarray, "times sensed"]:
    """One physics step for every command: in one call, since Python between them costs as much as they do.

    Args:
        rollout: that does it.
        model: the body.
        data: its state, which moves on.
        commands: of the actuators.
        wrenches: on the bodies all the while [N, N m], at their centers of mass; none
            if None.

    Returns:
        What sensors say at the start of every step.
    """
    inputs = mujoco.mjtState.mjSTATE_CTRL
    values = commands
    if wrenches is not None:
        inputs = inputs | mujoco.mjtState.mjSTATE_XFRC_APPLIED
        values = np.hstack([commands, np.tile(wrenches.ravel(), (len(commands), 1))])
    seen = np.empty((1, len(values), model.nsensordata))
    rollout.rollout(
        [model],
        [data],
        state_of(model, data, _PHYSICS)[None],
        values[None],
        control_spec=int(inputs),
        nstep=len(values),
        skip_checks=True,
        sensordata=seen if model.nsensordata else None,
    )
    return seen[0]


def state_of(
    model: mujoco.MjModel, data: mujoco.MjData, kind: mujoco.mjtState
) -> np.ndarray:
    """As one vector."""
    state = np.empty(mujoco.mj_stateSize(model, kind))
    mujoco.mj_getState(model, data, state, kind)
    return state


def taken_over(
    model: mujoco.MjModel, data: mujoco.MjData, new: mujoco.MjModel
) -> mujoco.MjData:
    """Data of a new model of the same form, which goes on where another is."""
    kind = mujoco.mjtState.mjSTATE_INTEGRATION
    going_on = mujoco.MjData(new)
    mujoco.mj_setState(new, going_on, state_of(model, data, kind), kind)
    new.qpos_spring = model.qpos_spring
    mujoco.mj_forward(new, going_on)
    return going_on
