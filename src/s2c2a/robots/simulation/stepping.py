"""Batches of MuJoCo physics steps, and transfer of a state to another model."""

import mujoco
import numpy as np
from jaxtyping import Float
from mujoco.rollout import Rollout


def run_physics_steps(
    rollout: Rollout,
    model: mujoco.MjModel,
    data: mujoco.MjData,
    commands: Float[np.ndarray, "times cables"],
    wrenches: Float[np.ndarray, "bodies 6"] | None,
) -> Float[np.ndarray, "times measurements"]:
    """Run one physics step per command, in a single call.

    A Python loop over the steps would take as long as the steps themselves.

    Args:
        rollout: MuJoCo's rollout object.
        model: the model.
        data: its state; advances in place.
        commands: of the actuators.
        wrenches: constant wrenches on the bodies at their centers of mass [N, N m];
            none if None.

    Returns:
        Sensor data at the start of every step.
    """
    control = mujoco.mjtState.mjSTATE_CTRL
    values = commands
    if wrenches is not None:
        control = control | mujoco.mjtState.mjSTATE_XFRC_APPLIED
        constant = np.tile(wrenches.ravel(), (len(commands), 1))
        values = np.hstack([commands, constant])
    measurements = np.empty((1, len(values), model.nsensordata))
    rollout.rollout(
        [model],
        [data],
        _get_state(model, data, mujoco.mjtState.mjSTATE_FULLPHYSICS)[None],
        values[None],
        control_spec=int(control),
        nstep=len(values),
        skip_checks=True,
        sensordata=measurements if model.nsensordata else None,
    )
    return measurements[0]


def transfer_state(
    model: mujoco.MjModel, data: mujoco.MjData, new_model: mujoco.MjModel
) -> mujoco.MjData:
    """Return data of a new model of the same structure in the state of another."""
    kind = mujoco.mjtState.mjSTATE_INTEGRATION
    new_data = mujoco.MjData(new_model)
    mujoco.mj_setState(new_model, new_data, _get_state(model, data, kind), kind)
    new_model.qpos_spring = model.qpos_spring
    mujoco.mj_forward(new_model, new_data)
    return new_data


def _get_state(
    model: mujoco.MjModel, data: mujoco.MjData, kind: mujoco.mjtState
) -> np.ndarray:
    state = np.empty(mujoco.mj_stateSize(model, kind))
    mujoco.mj_getState(model, data, state, kind)
    return state
