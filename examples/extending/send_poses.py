"""Send the pose of a module's end to S2C2A, in the frame of the arm's base.

python send_poses.py 9763 500     # port, number of frames
"""

import json
import socket
import sys
import time

sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
for frame in range(int(sys.argv[2])):
    end = {"position": [0.001 * frame, 0.0, 0.2], "rotation": [0.0, 0.0, 0.0, 1.0]}
    message = {"time": time.time(), "frame": frame, "bodies": {"end-1": end}}
    sender.sendto(json.dumps(message).encode(), ("127.0.0.1", int(sys.argv[1])))
    time.sleep(0.01)
