"""Options of classes, as users type them: `key=value`, converted to declared types."""

import inspect
from collections.abc import Callable, Mapping, Sequence
from inspect import Parameter
from typing import Any

from pydantic import PydanticUserError, TypeAdapter, ValidationError

from s2c2a.errors import S2C2AError, did_you_mean
from s2c2a.files.validation import describe_fault

_NAMED = (Parameter.POSITIONAL_OR_KEYWORD, Parameter.KEYWORD_ONLY)


def options_from(texts: Sequence[str]) -> tuple[tuple[str, str], ...]:
    """Parse options of the form `key=value`.

    Raises:
        S2C2AError: a text has no `=`, or a key appears twice.
    """
    options = {}
    for text in texts:
        key, equals, value = text.partition("=")
        if not (key and equals):
            raise S2C2AError(f"'{text}' is not an option; write key=value")
        if key in options:
            raise S2C2AError(
                f"the option '{key}' appears twice in {', '.join(texts)}; "
                "give each option once"
            )
        options[key] = value
    return tuple(options.items())


def named_parameters(cls: Callable) -> dict[str, Parameter]:
    """Return the parameters of a class that can be given by name."""
    parameters = inspect.signature(cls).parameters
    return {
        name: parameter
        for name, parameter in parameters.items()
        if parameter.kind in _NAMED
    }


def convert_option(
    cls: Callable, parameters: Mapping[str, Parameter], name: str, value: Any
) -> Any:
    """Convert an option to the type that the class declares for it.

    An option without a declared type is a number if its default is one, else text.

    Args:
        cls: the class, or a function that makes an object.
        parameters: those of its parameters that a user can set.
        name: of the option.
        value: as the user typed it.

    Raises:
        S2C2AError: there is no such option, or the value is not of its type.
    """
    if name not in parameters:
        raise S2C2AError(
            f"{_name(cls)} has no option '{name}'{did_you_mean(name, parameters)}; "
            f"it has {', '.join(parameters) or 'none'}"
        )
    try:
        declared = _declared_type(cls, parameters[name])
        return TypeAdapter(declared).validate_python(value)
    except (NameError, PydanticUserError):
        return value  # the declared type is not known here
    except ValidationError as error:
        fault = error.errors(include_url=False)[0]
        raise S2C2AError(
            f"option {name}={value} of {_name(cls)}: {describe_fault(fault)}"
        ) from error


def options_of(cls: Callable, texts: Sequence[str]) -> dict[str, Any]:
    """Parse and convert all options of a class: `options_from`, `convert_option`."""
    parameters = named_parameters(cls)
    return {
        name: convert_option(cls, parameters, name, value)
        for name, value in options_from(texts)
    }


def _declared_type(cls: Callable, parameter: Parameter) -> Any:
    """Annotation of a parameter, else the type of its default if that is a number."""
    function = cls.__init__ if isinstance(cls, type) else cls  # type: ignore[misc]
    annotations = inspect.get_annotations(function, eval_str=True)
    if parameter.name in annotations:
        return annotations[parameter.name]
    if isinstance(parameter.default, bool):
        return bool
    # a default of 1 may stand for a number that is not whole
    return int | float if isinstance(parameter.default, int | float) else Any


def _name(cls: Callable) -> str:
    return getattr(cls, "__name__", repr(cls))
