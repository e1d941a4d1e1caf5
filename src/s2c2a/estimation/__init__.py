"""What is known of an arm while it works: how it swings, what hangs at it, and where it is, from all that it sensors."""

from s2c2a.estimation.gains import Gains, gains_of
from s2c2a.estimation.learned_sensors import (
    PREFIX,
    LearnedNumbers,
    LearnedSense,
    learned_sensors,
    untrained_sensors,
)
from s2c2a.estimation.sensor_training import Heard, learn_numbers
from s2c2a.estimation.listening import Listener
from s2c2a.estimation.margins import Margins, margins_of, with_margins
from s2c2a.estimation.observer import Belief, Observer
from s2c2a.estimation.sensors import Sense, sensors_of
from s2c2a.estimation.modal_model import Swing, identified_swing

__all__ = [
    "PREFIX",
    "Belief",
    "Gains",
    "Heard",
    "LearnedNumbers",
    "LearnedSense",
    "Listener",
    "Margins",
    "Observer",
    "Sense",
    "Swing",
    "gains_of",
    "identified_swing",
    "learn_numbers",
    "learned_sensors",
    "margins_of",
    "sensors_of",
    "untrained_sensors",
    "with_margins",
]
