"""Options of a command that have an effect under a condition alone.

A command declares the condition, and is refused where it does not hold: an accepted
option always has an effect.
"""

import functools
import inspect
from collections import ChainMap
from collections.abc import Callable, Mapping
from dataclasses import dataclass, is_dataclass
from typing import Any

from s2c2a.errors import S2C2AError

Command = Callable[..., None]
Given = Mapping[str, Any]
"""Values of all parameters of a command, by name."""
CONDITIONS = "conditions"
"""Attribute of commands that have some."""


@dataclass(frozen=True)
class Condition:
    """A condition of some options.

    Attributes:
        options: names of the parameters.
        where: the condition in words, such as "with --random-arms".
        holds: whether the options have an effect beside the other values.
    """

    options: tuple[str, ...]
    where: str
    holds: Callable[[Given], bool]

    def check(self, given: Given, defaults: Given) -> None:
        """Refuse options without effect; their defaults are no options.

        Raises:
            S2C2AError: one is given where the condition does not hold.
        """
        named = [name for name in self.options if given[name] != defaults[name]]
        if not named or self.holds(given):
            return
        options = " and ".join(f"--{name.replace('_', '-')}" for name in named)
        raise S2C2AError(
            f"{options} would have no effect: it has one {self.where} alone; run it so, "
            f"or leave out {options}"
        )


def effective(
    *options: str, where: str, holds: Callable[[Given], bool]
) -> Callable[[Command], Command]:
    """Declare that options of a command have an effect under a condition alone.

    Args:
        options: names of parameters of the command.
        where: the condition in words, such as "with --random-arms".
        holds: the condition, from the values of all parameters.
    """
    condition = Condition(options, where, holds)

    def decorate(command: Command) -> Command:
        @functools.wraps(command)
        def checked(*args: Any, **options: Any) -> None:
            given = inspect.signature(command).bind(*args, **options).arguments
            check_conditions(checked, **given)
            inspect.unwrap(command)(**given)

        setattr(checked, CONDITIONS, (*conditions_of(command), condition))
        return checked

    return decorate


def check_conditions(command: Command, **given: Any) -> None:
    """Check the values of a command's parameters by all of its conditions.

    Raises:
        S2C2AError: an option would have no effect.
    """
    parameters = inspect.signature(command).parameters
    defaults = {name: parameters[name].default for name in parameters}
    for condition in conditions_of(command):
        condition.check(_flat(defaults | given), _flat(defaults))


def _flat(values: Given) -> Given:
    """Values by name, with those of options that commands share."""
    return ChainMap({**values}, *(vars(v) for v in values.values() if is_dataclass(v)))


def beside(option: str, *options: str) -> Callable[[Command], Command]:
    """Declare that options have an effect beside another one alone.

    Args:
        option: name of the parameter that must be given.
        options: names of the parameters that need it.
    """
    where = f"with --{option.replace('_', '-')}"
    return effective(*options, where=where, holds=lambda given: bool(given[option]))


def conditions_of(command: Command) -> tuple[Condition, ...]:
    """The conditions that a command declares."""
    return getattr(command, CONDITIONS, ())
