"""Scheduled faults as texts, such as "3 gone 4 1.5": one grammar for all emulators."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from s2c2a.errors import S2C2AError, did_you_mean

AFTER_TORQUE = "torque+"
"""Before a time: it counts from the moment at which the first torque is switched on."""


class Argument(NamedTuple):
    """One argument of a fault.

    Attributes:
        name: as users read it.
        low: smallest value.
        high: largest value; None: the argument names a target.
        required: whether it must be given.
    """

    name: str
    low: float = 0.0
    high: float | None = float("inf")
    required: bool = True

    def __str__(self) -> str:
        return self.name if self.required else f"[{self.name}]"

    def allows(self, word: str) -> bool:
        """Return whether a word is a value of the argument."""
        if self.high is None:
            return True
        try:
            return self.low <= float(word) <= self.high
        except ValueError:
            return False


SHARE = Argument("SHARE", high=1.0)
SECONDS = Argument("SECONDS")
MAYBE_SECONDS = SECONDS._replace(required=False)


@dataclass(frozen=True)
class Fault:
    """One scheduled fault.

    Attributes:
        time: when it occurs [s].
        kind: a name in the kinds of its grammar.
        targets: servos or bodies among its arguments.
        values: numbers among its arguments.
        after_torque: whether the time counts from the first torque, not from the start.
    """

    time: float
    kind: str
    targets: tuple[str, ...] = ()
    values: tuple[float, ...] = ()
    after_torque: bool = False


@dataclass(frozen=True)
class FaultGrammar:
    """The faults of one emulator.

    Attributes:
        noun: what they are, for messages.
        target: what they name, "servo" or "body".
        kinds: of faults, with their arguments.
        example: of a fault.
        has_torque: whether a time may count from the first torque.
    """

    noun: str
    target: str
    kinds: Mapping[str, tuple[Argument, ...]]
    example: str
    has_torque: bool = False

    def parse(self, texts: Sequence[str], targets: Sequence[object]) -> list[Fault]:
        """Parse faults such as `example`, and sort them by time.

        Args:
            texts: one fault each.
            targets: names of all servos or bodies.

        Raises:
            S2C2AError: a fault has no valid time, kind or arguments.
        """
        names = [str(target) for target in targets]
        faults = [self._parse(text, names) for text in texts]
        return sorted(faults, key=lambda fault: fault.time)

    def _parse(self, text: str, targets: Sequence[str]) -> Fault:
        parts = text.split()
        time, kind, *words = parts if len(parts) > 1 else ("", "")
        after_torque = self.has_torque and time.startswith(AFTER_TORQUE)
        if after_torque:
            time = time.removeprefix(AFTER_TORQUE)
        arguments = self.kinds.get(kind)
        is_time = SECONDS.allows(time) and time != "inf"
        if arguments is None or not is_time or not _fit(words, arguments):
            raise self._invalid(text)
        pairs = list(zip(words, arguments, strict=False))
        named = tuple(word for word, argument in pairs if argument.high is None)
        if not set(named) <= set(targets) or len(set(named)) < len(named):
            raise S2C2AError(
                f"'{text}' names {self.target} {', '.join(named)}; name one, or "
                f"different ones, of {', '.join(targets)}"
            )
        values = (float(word) for word, argument in pairs if argument.high is not None)
        return Fault(float(time), kind, named, tuple(values), after_torque)

    def _invalid(self, text: str) -> S2C2AError:
        kind = "".join(text.split()[1:2])
        suggested = "" if kind in self.kinds else did_you_mean(kind, self.kinds)
        words = [(name, *map(str, values)) for name, values in self.kinds.items()]
        kinds = [" ".join(parts) for parts in words]
        torque = ""
        if self.has_torque:
            torque = f" (after '{AFTER_TORQUE}', from the first torque on)"
        return S2C2AError(
            f"'{text}' is not {self.noun}{suggested}; write a time [s]{torque} and one "
            f'of: {", ".join(kinds)}; for example "{self.example}"'
        )


def _fit(words: Sequence[str], arguments: tuple[Argument, ...]) -> bool:
    required = sum(argument.required for argument in arguments)
    if not required <= len(words) <= len(arguments):
        return False
    pairs = zip(words, arguments, strict=False)
    return all(argument.allows(word) for word, argument in pairs)


class FaultShares:
    """Faults that hit a share of the packets, from now on, until their share is 0.

    Attributes:
        values: arguments of each kind; the last one is the share.
    """

    def __init__(self, random: np.random.Generator):
        """Hit nothing.

        Args:
            random: decides which packets are hit.
        """
        self._random = random
        self.values: dict[str, tuple[float, ...]] = {}

    def hits(self, kind: str) -> bool:
        """Return whether a kind hits the next packet."""
        values = self.values.get(kind)
        return values is not None and self._random.random() < values[-1]
