from .actions import C2A, History
from .c2s import C2S, C2SOptions, ForwardOptions
from .chain_training import ChainOptions
from .local_training import LocalOptions

__all__ = [
    "C2A",
    "C2S",
    "C2SOptions",
    "ChainOptions",
    "ForwardOptions",
    "History",
    "LocalOptions",
]
