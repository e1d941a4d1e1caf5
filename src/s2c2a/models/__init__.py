"""The models: from configurations to states, and from them to actions; how each is built, trained and asked."""

from s2c2a.models.c2a import C2A, C2AOptions, History
from s2c2a.models.c2s import C2S, C2SOptions
from s2c2a.models.chain import ChainOptions
from s2c2a.models.lstm import LSTMOptions
from s2c2a.models.options import ForwardOptions
