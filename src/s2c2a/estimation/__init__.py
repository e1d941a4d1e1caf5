"""What is known of an arm while it works: how it swings, what hangs at it, and where it is, from all that it senses."""

from s2c2a.estimation.gains import Gains, gains_of
from s2c2a.estimation.learned import (
    PREFIX,
    LearnedNumbers,
    LearnedSense,
    learned_senses,
    untrained_senses,
)
from s2c2a.estimation.learning import Heard, learn_numbers
from s2c2a.estimation.listening import Listener
from s2c2a.estimation.margins import Margins, margins_of, with_margins
from s2c2a.estimation.observer import Belief, Observer
from s2c2a.estimation.senses import Sense, senses_of
from s2c2a.estimation.swing import Swing, identified_swing

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
    "learned_senses",
    "margins_of",
    "senses_of",
    "untrained_senses",
    "with_margins",
]
