"""Faults of emulated motion capture: of the network, the bodies and the program."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from s2c2a.errors import S2C2AError, did_you_mean

EXAMPLE = "3 hidden end-2 1.5"


class _Argument(NamedTuple):
    """One argument of a fault.

    Attributes:
        name: as users read it.
        high: largest value; None: the argument is the name of a body.
        required: whether it must be given.
        low: smallest value.
    """

    name: str
    high: float | None = float("inf")
    required: bool = True
    low: float = 0.0


_SHARE = _Argument("SHARE", 1.0)
_SECONDS = _Argument("SECONDS")
_BODY = _Argument("BODY", None)
KINDS: dict[str, tuple[_Argument, ...]] = {
    "lost": (_SHARE,),
    "late": (_SECONDS, _SHARE),
    "reordered": (_SHARE,),
    "duplicated": (_SHARE,),
    "garbage": (_SHARE,),
    "incomplete": (_SHARE,),
    "absurd": (_SHARE,),
    "hidden": (_BODY, _SECONDS._replace(required=False)),
    "frozen": (_BODY, _SECONDS._replace(required=False)),
    "swapped": (_BODY, _BODY),
    "flipped": (_BODY,),
    "millimeters": (),
    "knocked": (_Argument("METERS", 1.0),),
    "restart": (_SECONDS,),
    "drift": (_Argument("PPM", 1e5, low=-1e5),),
}
"""Kinds of faults and their arguments.

lost, late, reordered, duplicated, garbage: share of the frames that are lost, come
later, come after the next one, come twice, are followed by a damaged copy; incomplete:
lack a part; absurd: have a body with impossible numbers; from then on, until the kind
comes again with share 0. hidden: the body is not tracked, for good or for a time.
frozen: its last pose comes again as if it were tracked, for good or for a time.
swapped: two bodies have each other's poses; flipped: a body is turned by 180 deg about
its x axis; millimeters: positions are in mm, against the protocol; until the kind comes
again. knocked: the world frame shifts along x, for good. restart: the program is off
for a time and forgets its clients; its clock begins again. drift: its clock
runs faster than that of this computer.
"""
SHARE_KINDS = frozenset(
    ("lost", "late", "reordered", "duplicated", "garbage", "incomplete", "absurd")
)
"""Kinds that act on a share of the frames."""


@dataclass(frozen=True)
class MocapFault:
    """One scheduled fault.

    Attributes:
        time: when it occurs [s].
        kind: a name in `KINDS`.
        bodies: names among its arguments.
        values: numbers among its arguments.
    """

    time: float
    kind: str
    bodies: tuple[str, ...]
    values: tuple[float, ...]


def parse_mocap_faults(texts: Sequence[str], bodies: Sequence[str]) -> list[MocapFault]:
    """Parse faults such as `EXAMPLE`, and sort them by time.

    Args:
        texts: one fault each.
        bodies: names of the rigid bodies.

    Raises:
        S2C2AError: a fault has no valid time, kind or arguments.
    """
    faults = [_parse_fault(text, bodies) for text in texts]
    return sorted(faults, key=lambda fault: fault.time)


def _parse_fault(text: str, bodies: Sequence[str]) -> MocapFault:
    time, kind, *words = text.split() if len(text.split()) > 1 else ("", "")
    arguments = KINDS.get(kind)
    if arguments is None or not _is_time(time) or not _fit(words, arguments):
        raise _invalid_fault(text)
    pairs = list(zip(words, arguments, strict=False))
    named = tuple(word for word, argument in pairs if argument.high is None)
    unknown = [name for name in named if name not in bodies]
    if unknown or len(set(named)) < len(named):
        raise S2C2AError(
            f"'{text}' names the bodies {list(named)}; name different ones of "
            f"{', '.join(bodies)}"
        )
    values = (float(word) for word, argument in pairs if argument.high is not None)
    return MocapFault(float(time), kind, named, tuple(values))


def _is_time(text: str) -> bool:
    return _is_allowed(text, _SECONDS) and text != "inf"


def _fit(words: Sequence[str], arguments: tuple[_Argument, ...]) -> bool:
    required = sum(argument.required for argument in arguments)
    if not required <= len(words) <= len(arguments):
        return False
    return all(map(_is_allowed, words, arguments))


def _is_allowed(word: str, argument: _Argument) -> bool:
    if argument.high is None:
        return True
    try:
        return argument.low <= float(word) <= argument.high
    except ValueError:
        return False


def _suggested(text: str) -> str:
    kind = "".join(text.split()[1:2])
    return "" if kind in KINDS else did_you_mean(kind, KINDS)


def _invalid_fault(text: str) -> S2C2AError:
    kinds = [" ".join((kind, *map(_describe, KINDS[kind]))) for kind in KINDS]
    return S2C2AError(
        f"'{text}' is not a fault of motion capture{_suggested(text)}; "
        "write a time [s] and one of: "
        f'{", ".join(kinds)}; for example "{EXAMPLE}"'
    )


def _describe(argument: _Argument) -> str:
    return argument.name if argument.required else f"[{argument.name}]"
