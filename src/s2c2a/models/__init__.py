"""Learned models: forward models (C2S) and configuration controllers (C2A)."""

from s2c2a.models.actions import C2A, History, LSTMOptions
from s2c2a.models.c2s import C2S, C2SOptions, ForwardOptions
from s2c2a.models.chain_training import ChainOptions
from s2c2a.models.local_training import LocalOptions
