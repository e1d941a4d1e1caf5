"""A small imitation of the Helix's rosbridge: tendons that follow commands with a lag."""

import json
import threading
import time
from contextlib import suppress

import numpy as np
from websockets.exceptions import ConnectionClosed
from websockets.sync.server import serve

RATE = 100.0  # Hz, of the real bridge's controllers
LAG = 0.05  # s
STRAIGHT = np.repeat([0.1025, 0.215, 0.215], 3)  # m, of the middle of their ranges
NAMES = [f"tendon{number}" for number in range(9)]
SHUFFLED = [4, 0, 8, 1, 2, 7, 3, 6, 5]  # joint states come in any order


class HelixBridge:
    """Serves one robot on a free port of this machine.

    Attributes:
        state: of the system.
        lengths: of the tendons [m], as the interface states them.
        silent: whether it sends nothing.
        advertised: types of the topics that were advertised.
    """

    def __init__(self, interface="sdk", bent=0.0):
        self.interface = interface
        self.zero = STRAIGHT if interface == "sdk" else np.zeros(9)
        self.lengths = self.zero + bent * np.tile([-1.0, 0.5, 0.5], 3)
        self.desired = self.lengths.copy()
        self.state = "RUNNING"
        self.silent = False
        self.advertised = {}
        self.commands = 0
        self._subscribed = set()
        self._server = serve(self._talk, "127.0.0.1", 0)
        self.port = self._server.socket.getsockname()[1]
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    def close(self):
        self._server.shutdown()

    def _talk(self, socket):
        ended = threading.Event()
        sender = threading.Thread(target=self._send_all, args=(socket, ended))
        sender.start()
        try:
            for text in socket:
                self._obey(json.loads(text))
        finally:
            ended.set()
            sender.join()

    def _obey(self, message):
        match message["op"]:
            case "advertise":
                self.advertised[message["topic"]] = message["type"]
            case "subscribe":
                self._subscribed.add(message["topic"])
            case "publish" if message["topic"] in self.advertised:
                content = message["msg"]
                values = content.get("values", content.get("data"))
                if self.state == "RUNNING":
                    self.desired = np.array(values, float)
                    self.commands += 1

    def _send_all(self, socket, ended):
        last = time.perf_counter()
        with suppress(ConnectionClosed):
            while not ended.wait(1 / RATE):
                now = time.perf_counter()
                remaining = np.exp(-(now - last) / LAG)
                self.lengths = self.desired + remaining * (self.lengths - self.desired)
                last = now
                for topic, content in self._messages():
                    if topic in self._subscribed and not self.silent:
                        text = {"op": "publish", "topic": topic, "msg": content}
                        socket.send(json.dumps(text))

    def _messages(self):
        names = [NAMES[number] for number in SHUFFLED]
        values = self.lengths[SHUFFLED].tolist()
        yield "/helix/state/system_state", {"data": self.state}
        yield (
            "/helix/estimated/tendon_lengths",
            {"interface_names": names, "values": values},
        )
        yield (
            "/tendon_transmission_node/tendon_states",
            {"name": names, "position": values, "velocity": [], "effort": []},
        )
