"""What a recipe decides: here, which arm its networks see."""

from dataclasses import replace

import pytest

from s2c2a.arm import load_arm
from s2c2a.arm.sensors import Camera, Inertial, Sensors
from s2c2a.components import CustomComponent
from s2c2a.estimation import EncoderOnly, KalmanFilter
from s2c2a.strategies import RECIPES

SENSORS = Sensors(imu=Inertial(), camera=Camera(), bends=True)
ESTIMATORS = [EncoderOnly(), KalmanFilter(), CustomComponent("not_there.py:Mine")]


@pytest.fixture(scope="module")
def arm():
    """An arm that senses true configurations, and has further sensors."""
    return load_arm("simulated_arm").model_copy(update={"sensors": SENSORS})


@pytest.mark.parametrize("recipe", RECIPES.values(), ids=RECIPES)
def test_networks_see_the_same_arm_whatever_the_estimator(recipe, arm):
    seen = {
        (changed.planning_arm(arm), changed.training_arm(arm))
        for changed in (replace(recipe, estimator=kind) for kind in ESTIMATORS)
    }
    assert len(seen) == 1


def test_encoders_alone_hide_all_other_sensors_from_networks(arm):
    best = RECIPES["best"]
    for seen in (best.planning_arm(arm), best.training_arm(arm)):
        assert seen.sensing == "encoders"
        assert seen.sensors == Sensors()
        assert seen.motor.current_noise is None
    assert RECIPES["paper"].planning_arm(arm) == arm
    assert RECIPES["paper"].training_arm(arm) == arm
