"""Forward models by name."""

from s2c2a.models import C2SOptions, ChainOptions, ForwardOptions, LocalOptions
from s2c2a.registry import OptionsRegistry

MODELS = OptionsRegistry(
    "model",
    ForwardOptions,  # type: ignore[type-abstract]
    {"bilstm": C2SOptions, "chain": ChainOptions, "local": LocalOptions},
)
"""Forward models by name, for `[c2s] model` in a recipe."""
