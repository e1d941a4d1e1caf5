"""Sockets of a NatNet client."""

import os
import socket

from s2c2a.lab.tracking.poses import TrackingError

RECEIVE_BUFFER = 1 << 20  # bytes; frames wait here while the computer is busy


def open_socket(local: str, group: str = "", port: int = 0) -> socket.socket:
    """Return a socket for requests, their answers and unicast frames; or for multicast.

    Several programs may listen to a group.

    Args:
        local: address of this computer in the network of Motive.
        group: multicast address; empty: unicast.
        port: of the frames of a group.

    Raises:
        TrackingError: the address is not of this computer, or the group cannot be
            joined.
    """
    opened = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
        if group:
            opened.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            # bound to the group, the socket gets no frames of other groups; Windows refuses it
            opened.bind((local if os.name == "nt" else group, port))
            membership = socket.inet_aton(group) + socket.inet_aton(local)
            opened.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, membership)
        else:
            opened.bind((local, port))
    except (OSError, ValueError, TypeError) as error:
        opened.close()
        place = f"the group {group!a}:{port} on " if group else ""
        raise TrackingError(
            f"cannot listen to {place}{local!a}: {error}; give the address of this "
            "computer in the network of Motive"
        ) from error
    opened.setblocking(False)
    return opened
