"""What a recipe decides: here, which arm its networks see."""

from dataclasses import replace

import pytest

from s2c2a.arm import load_arm
from s2c2a.arm.sensors import Camera, Flex, Inertial, Sensors
from s2c2a.estimation import EncoderOnly, KalmanFilter
from s2c2a.plugins.components import CustomComponent
from s2c2a.strategies import RECIPES

SENSORS = Sensors(imu=Inertial(), camera=Camera(), bends=True, flex=Flex())
ESTIMATORS = [EncoderOnly(), KalmanFilter(), CustomComponent("not_there.py:Mine")]


@pytest.fixture(scope="module")
def arm():
    """An arm that senses true configurations, and has further sensors."""
    return load_arm("simulated_arm").model_copy(update={"sensors": SENSORS})


@pytest.mark.parametrize("recipe", RECIPES.values(), ids=RECIPES)
def test_networks_see_the_same_arm_whatever_the_estimator(recipe, arm):
    seen = {replace(recipe, estimator=kind).seen_arm(arm) for kind in ESTIMATORS}
    assert len(seen) == 1


def test_encoders_alone_hide_all_sensors_but_learned_ones_from_networks(arm):
    seen = RECIPES["best"].seen_arm(arm)
    assert seen.sensing == "encoders"
    assert seen.sensors == Sensors(flex=SENSORS.flex)
    assert seen.motor.current_noise is None
    assert RECIPES["paper"].seen_arm(arm) == arm
