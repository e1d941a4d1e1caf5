"""Send the bodies of a VRPN server (Vicon, OptiTrack, others) to S2C2A.

    python bridge_vrpn.py HOST 9763 base end-1 end-2 end-3     # port, names of the bodies

Bodies keep their names; `[tracking]` in the arm file has source = "udp:9763".
"""

import itertools
import json
import socket
import sys
import time

try:
    import vrpn  # VRPN's own Python module, built from its sources
except ImportError:
    sys.exit("the module vrpn is missing; build VRPN with Python, then import vrpn")

host, port, *names = sys.argv[1:]
sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
bodies = {}
trackers = [vrpn.receiver.Tracker(f"{name}@{host}") for name in names]
for name, tracker in zip(names, trackers, strict=True):
    # VRPN: meters, and quaternions (x, y, z, w), as in the datagrams
    tracker.register_change_handler(name, bodies.__setitem__, "position")
for frame in itertools.count():
    for tracker in trackers:
        tracker.mainloop()
    if found := {
        name: {"position": list(one["position"]), "rotation": list(one["quaternion"])}
        for name, one in bodies.items()
    }:
        message = {"time": time.monotonic(), "frame": frame, "bodies": found}
        sender.sendto(json.dumps(message).encode(), ("127.0.0.1", int(port)))
    bodies.clear()
    time.sleep(0.005)
