"""What `ForwardOptions` does for every model: states and deviations along episodes."""

from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
import pytest

from s2c2a.models import ForwardOptions
from s2c2a.models.forward_model import ForwardModel, PCCForwardModel
from s2c2a.training import TrainingData


class Counting(ForwardModel):
    """Its memory is the number of readings, which is also its deviation."""

    def start(self, sensed):
        return jnp.zeros(())

    def observe(self, sensed, memory):
        return memory + 1.0

    def predict(self, configurations, memory, disturbances=None):
        return jnp.zeros((*configurations.shape[:-1], 6))

    def for_planning(self):
        return self

    def predictive_std(self, configurations, memory):
        return jnp.broadcast_to(memory, configurations.shape[:-1])


@dataclass(frozen=True)
class Options(ForwardOptions):
    """Of a model that is given."""

    def untrained(self, arm, key):
        raise NotImplementedError

    def train(self, data, fit, key, progress=None):
        raise NotImplementedError


@pytest.fixture
def data(make_arm):
    """Two episodes of four samples at rest."""
    sensed = np.broadcast_to([0.0, 0.0, 1.0], (2, 4, 3, 3))
    return TrainingData(
        make_arm(3), sensed, np.zeros((2, 4, 3, 3)), np.zeros((2, 4, 3, 6))
    )


def test_deviations_follow_the_memory_of_every_episode(data):
    deviations = Options().deviations(Counting(), data)
    assert deviations.shape == (2, 4, 3)
    np.testing.assert_array_equal(deviations[..., 0], [[0, 1, 2, 3], [0, 1, 2, 3]])


def test_a_model_without_deviation_has_none_along_an_episode(data):
    model = PCCForwardModel.of(data.arm)
    assert not Options().deviations(model, data).any()
    assert Options().predictions(model, data).shape == data.states.shape
