"""Send a stream of the Lab Streaming Layer to S2C2A.

    python bridge_lsl.py NAME 9763 base end-1 end-2 end-3     # stream, port, bodies

The stream has seven channels a body: x, y, z [m], and the quaternion x, y, z, w. A body
that is lost has NaN.
"""

import itertools
import json
import math
import socket
import sys

try:
    import pylsl
except ImportError:
    sys.exit("pylsl is missing; install it with: pip install pylsl")

stream, port, *names = sys.argv[1:]
sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
found = pylsl.resolve_byprop("name", stream, timeout=10.0)
if not found:
    sys.exit(f"no stream '{stream}' in 10 s; start it, or name another")
inlet = pylsl.StreamInlet(found[0])
for frame in itertools.count():
    values, moment = inlet.pull_sample()
    if len(values) != 7 * len(names):
        sys.exit(f"{len(values)} channels for {len(names)} bodies; 7 a body are needed")
    rows = [values[7 * number :][:7] for number in range(len(names))]
    bodies = {
        name: {"position": row[:3], "rotation": row[3:]}
        for name, row in zip(names, rows, strict=True)
        if all(map(math.isfinite, row))
    }
    message = {"time": moment, "frame": frame, "bodies": bodies}
    sender.sendto(json.dumps(message).encode(), ("127.0.0.1", int(port)))
