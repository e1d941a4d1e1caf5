"""Forward models by name."""

from s2c2a.models import C2SOptions, ChainOptions, ForwardOptions, LocalOptions
from s2c2a.plugins.components import Registry

MODELS: Registry[ForwardOptions] = Registry(
    "model",
    ForwardOptions,
    {"bilstm": C2SOptions, "chain": ChainOptions, "local": LocalOptions},
)
"""Forward models by name, for `[c2s] model` in a recipe."""
