"""Forward models by name."""

import sys
from hashlib import blake2b
from pathlib import Path

from s2c2a.errors import ForeignCodeError, StrategyError
from s2c2a.plugins import found
from s2c2a.models import C2SOptions, ChainOptions, ForwardOptions, LocalOptions

MODELS: dict[str, type[ForwardOptions]] = {
    "bilstm": C2SOptions,
    "chain": ChainOptions,
    "local": LocalOptions,
}


def model_named(name: str) -> type[ForwardOptions]:
    """The options of a forward model: of the package, of others, or in a file of the user's.

    Raises:
        S2C2AError: nothing of that name.
        StrategyError: it is no forward model.
    """
    kind = found("model", name, MODELS)
    if not (isinstance(kind, type) and issubclass(kind, ForwardOptions)):
        raise StrategyError(
            f"'{name}' holds no forward model's options; derive it from s2c2a.models.ForwardOptions"
        )
    return kind


def model_known(name: str) -> type[ForwardOptions]:
    """The same for a name from a file that somebody else may have made: nothing is imported for it.

    Raises:
        ForeignCodeError: of none that the user has asked for, or imported.
    """
    known = {name_of(kind): kind for kind in _below(ForwardOptions)}  # type: ignore[type-abstract]
    if name not in known:
        raise ForeignCodeError(
            f"its forward model is '{name}', code that does not come with the package, and none is run because a file "
            "says so; if you trust it, name it with --model module:Name or file.py:Name, or import it in Python"
        )
    return known[name]


def name_of(kind: type[ForwardOptions]) -> str:
    """What files call the options of a forward model, wherever they were found."""
    own = next((name for name, known in MODELS.items() if known is kind), None)
    return own or f"{kind.__module__}:{kind.__qualname__}"


def code_of(kind: type[ForwardOptions]) -> str:
    """A digest of the file in which a forward model of the user's stands; nothing for those of the package."""
    file = getattr(sys.modules.get(kind.__module__), "__file__", None)
    return (
        ""
        if kind in MODELS.values() or file is None
        else blake2b(Path(file).read_bytes()).hexdigest()
    )


def _below(kind: type[ForwardOptions]) -> list[type[ForwardOptions]]:
    return [kind, *(one for child in kind.__subclasses__() for one in _below(child))]
