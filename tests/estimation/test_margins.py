"""Margins of the loop: promised ones are kept, by randomized arms and with every set of sensors, and they mean something."""

import jax.numpy as jnp
import numpy as np
import pytest
from s2c2a.estimation.margins import (
    MAX_DELAY,
    MAX_GAIN,
    PROMISED,
    _filter_gain,
    _gain_margin,
    _loop,
    _stable,
)

from s2c2a.arm import ArmGeometry, load_arm
from s2c2a.arm.randomized import randomized_arm
from s2c2a.arm.sensors import Camera, Inertial, Sensors
from s2c2a.estimation import (
    Observer,
    Swing,
    gains_of,
    margins_of,
    sensors_of,
    with_margins,
)

ALL = Sensors(imu=Inertial(), camera=Camera())


def watched(arm) -> Observer:
    springs = ArmGeometry.of(arm).cable_springs
    return Observer.of(arm, gains_of(arm, Swing.nominal()), sensors_of(arm, springs))


def sensing(arm, what):
    motor = arm.motor.model_copy(
        update={"current_noise": 0.15, "current_friction": 0.2}
    )
    parts = {
        "bends": {"sensing": "true"},
        "imu": {"sensors": Sensors(imu=Inertial())},
        "camera": {"sensors": Sensors(camera=Camera())},
        "current": {"motor": motor},
        "all": {"sensing": "true", "sensors": ALL, "motor": motor},
    }
    return arm.model_copy(update=parts[what])


@pytest.mark.parametrize("what", ["bends", "imu", "camera", "current", "all"])
@pytest.mark.parametrize("seed", [0, 1])
def test_drawn_arms_have_the_margins_that_are_promised(what, seed):
    arm = sensing(randomized_arm(load_arm("twin_arm"), seed, 1.0), what)
    margins = margins_of(arm, with_margins(arm, watched(arm)))
    assert margins.gain >= PROMISED.gain - 0.05
    assert margins.delay >= PROMISED.delay


def test_beyond_its_margin_the_loop_swings_and_within_it_does_not():
    arm = sensing(load_arm("twin_arm"), "imu")
    loop = _loop(arm, watched(arm), 0)
    margin, filtering = _gain_margin(loop), _filter_gain(loop)
    assert _stable(loop, filtering, 0.95 * margin, 0)
    assert not _stable(loop, filtering, 1.1 * margin, 0)


def test_a_rash_observer_becomes_cautious():
    arm = sensing(load_arm("twin_arm"), "camera")
    camera = arm.sensors.camera.model_copy(update={"delay": 0.6})
    late = arm.model_copy(update={"sensors": Sensors(camera=camera)})
    caution = np.asarray(with_margins(late, watched(late)).gains.caution)
    assert caution.max() > 1.0
    assert (np.diff(caution) >= 0).all()


def test_nothing_that_is_sensed_is_no_loop():
    arm = load_arm("twin_arm")
    margins = margins_of(arm, watched(arm))
    assert (margins.gain, margins.delay) == (MAX_GAIN, MAX_DELAY)
    assert not jnp.any(with_margins(arm, watched(arm)).gains.caution != 1.0)
