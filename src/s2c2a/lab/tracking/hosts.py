"""Addresses of the computers that stream poses."""

import socket

from s2c2a.lab.tracking.poses import TrackingError

LOCALHOST = "127.0.0.1"
MAX_PORT = 65_535


def check_port(port: int, protocol: str, lowest: int = 1) -> None:
    """Check the number of a port.

    Raises:
        TrackingError: there is no such port.
    """
    if not lowest <= port <= MAX_PORT:
        raise TrackingError(f"{protocol} port {port}; choose {lowest} to {MAX_PORT}")


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
