from .babbling import BABBLING, episode_actions
from .collecting import CollectOptions, collect, describe_excluded
from .recording import Recording, load_recording
from .windows import Samples, Split, controller_samples, forward_samples

__all__ = [
    "BABBLING",
    "CollectOptions",
    "Recording",
    "Samples",
    "Split",
    "collect",
    "controller_samples",
    "describe_excluded",
    "episode_actions",
    "forward_samples",
    "load_recording",
]
