"""Addresses of the computers that stream poses."""

import socket

from s2c2a.lab.tracking.poses import TrackingError


def resolve(host: str) -> str:
    """Return the IPv4 address of a host.

    Raises:
        TrackingError: there is no such host.
    """
    try:
        return socket.gethostbyname(host)
    # TypeError, ValueError: a name that cannot be a host
    except (OSError, TypeError, ValueError) as error:
        raise TrackingError(
            f"no host {host!a}: {error}; give the address of the computer that streams"
        ) from error
