"""Training data: babbling, data collection, recordings, splits, and windows."""

from s2c2a.data.babbling import BABBLING, episode_actions
from s2c2a.data.collecting import CollectOptions, collect, describe_excluded
from s2c2a.data.recording import Recording, load_recording
from s2c2a.data.windows import Samples, Split, controller_samples, forward_samples
