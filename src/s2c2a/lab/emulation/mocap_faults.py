"""Faults of emulated motion capture: of the network, the bodies and the program."""

from s2c2a.lab.emulation.fault_texts import (
    MAYBE_SECONDS,
    SECONDS,
    SHARE,
    Argument,
    FaultGrammar,
)

_BODY = Argument("BODY", high=None)
KINDS: dict[str, tuple[Argument, ...]] = {
    "lost": (SHARE,),
    "late": (SECONDS, SHARE),
    "reordered": (SHARE,),
    "duplicated": (SHARE,),
    "garbage": (SHARE,),
    "incomplete": (SHARE,),
    "absurd": (SHARE,),
    "hidden": (_BODY, MAYBE_SECONDS),
    "frozen": (_BODY, MAYBE_SECONDS),
    "swapped": (_BODY, _BODY),
    "flipped": (_BODY,),
    "millimeters": (),
    "knocked": (Argument("METERS", high=1.0),),
    "restart": (SECONDS,),
    "drift": (Argument("PPM", -1e5, 1e5),),
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


GRAMMAR = FaultGrammar("a fault of motion capture", "body", KINDS, "3 hidden end-2 1.5")
