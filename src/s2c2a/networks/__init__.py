"""The networks: biLSTMs that run along the modules of an arm, and a chain of arcs with memory."""

from s2c2a.networks.bilstm import BiLSTM
from s2c2a.networks.c2a import C2A, History, module_labels
from s2c2a.networks.c2s import C2S
from s2c2a.networks.chain_c2s import ChainC2S, ChainSize
from s2c2a.networks.scaling import Scaling
from s2c2a.networks.sum_and_range import SumAndRange

__all__ = ["C2A", "C2S", "BiLSTM", "ChainC2S", "ChainSize", "History", "Scaling", "SumAndRange", "module_labels"]
