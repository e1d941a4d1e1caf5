"""Trackers by name: sources of poses, as users write them."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from s2c2a.errors import S2C2AError, did_you_mean
from s2c2a.lab.tracking.poses import TrackingError
from s2c2a.lab.tracking.tracker import Tracker
from s2c2a.plugins.discovery import located, resolve
from s2c2a.plugins.options import convert_option, named_parameters, options_from

_ADDRESSES: Mapping[str, Sequence[tuple[str, ...]]] = {
    "udp": [(), ("port",), ("host", "port")],
    "natnet": [(), ("host",)],
    "qualisys": [(), ("host",)],
    "camera": [("device", "camera_file"), ("device", "camera_file", "layout_file")],
}
"""Options that can be written behind the name, with colons."""
FILES = {"device", "camera_file", "layout_file"}
"""Options that can name a file."""
FORMS = (
    "udp, udp:PORT, udp:HOST:PORT, natnet:HOST, qualisys:HOST, "
    "camera:DEVICE:CAMERA_FILE, "
    "camera:DEVICE:CAMERA_FILE:LAYOUT_FILE, or your own FILE.py:Class"
)


def tracker_of(source: str) -> Tracker:
    """Return the tracker of a source; it does not receive yet.

    Args:
        source: one of `FORMS`, and options of the tracker's class behind commas, such
            as "natnet:192.168.1.10,local=192.168.1.20,up=z".

    Raises:
        UntrustedCodeError: the source is code that the user has not named, since it may
            come from the arm of a recording (`plugins.trust_code`).
        S2C2AError: there is no such source, it has no such option, or its class fails.
    """
    text, *given = source.split(",")
    name, *address = text.split(":")
    if name not in _ADDRESSES:
        # refuse a misspelled protocol: a user's class is in a file or a module
        place, _, cls = text.partition(":")
        if ":" in text and not (place.endswith(".py") or cls.isidentifier()):
            raise TrackingError(
                f"'{text}' is no tracking source{did_you_mean(place, _ADDRESSES)}; give {FORMS}"
            )
        return _make(_own_class(text), dict(options_from(given)))
    names = next((n for n in _ADDRESSES[name] if len(n) == len(address)), None)
    if names is None or "" in address:
        raise TrackingError(f"'{text}' is no tracking source; give {FORMS}")
    options = dict(zip(names, address, strict=True)) | dict(options_from(given))
    for option in FILES & options.keys():
        if file := options[option]:
            options[option] = str(located(source, file))
    return _make(resolve("tracker", name, {}), options)


def _own_class(text: str) -> Any:
    """A class from another package or from a user's file."""
    cls = resolve("tracker", text, {})
    if not (isinstance(cls, type) and issubclass(cls, Tracker)):
        raise TrackingError(
            f"{text} is {cls!r}, not a tracker; give a subclass of "
            "s2c2a.lab.tracking.Tracker"
        )
    return cls


def _make(cls: Callable[..., Tracker], options: Mapping[str, str]) -> Tracker:
    parameters = named_parameters(cls)
    converted = {
        name: convert_option(cls, parameters, name, value)
        for name, value in options.items()
    }
    try:
        return cls(**converted)
    except (S2C2AError, OSError):
        raise
    except Exception as error:  # the class may be a user's own
        raise TrackingError(
            f"{cls.__name__} cannot be made: {type(error).__name__}: {error}; its "
            f"options are {', '.join(parameters) or 'none'}, written as SOURCE,KEY=VALUE"
        ) from error
