"""Send the poses of an arm with one module to S2C2A, as JSON datagrams over UDP."""

import json
import socket
import sys
import time

sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
still = {"position": [0.0, 0.0, 0.0], "rotation": [0.0, 0.0, 0.0, 1.0]}
for frame in range(int(sys.argv[2])):  # replace the poses by those of your tracker
    bodies = {"base": still, "end-1": still | {"position": [0.01, 0.0, 0.2]}}
    datagram = {"time": time.time(), "frame": frame, "bodies": bodies}
    sender.sendto(json.dumps(datagram).encode(), ("127.0.0.1", int(sys.argv[1])))
    time.sleep(0.01)
