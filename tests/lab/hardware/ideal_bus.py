"""A bus of ideal servos: they are where they were sent, at once."""

from s2c2a.lab.hardware.bus import BusError, ServoBus, ServoInfo, ServoState


class IdealBus(ServoBus):
    """Servos without errors, which must be prepared as real ones."""

    ticks_per_turn = 4096
    torque_constant = 0.35
    baud_rates = (1_000_000,)

    def __init__(self, has_watchdog=True):
        self.has_watchdog = has_watchdog
        self.prepared = set()
        self.positions = {}
        self.torque = {}
        self.restarted = set()

    def scan(self, ids=()):
        return [ServoInfo(id, 1200, "xl330-m288", 52) for id in ids]

    def set_baud_rate(self, baud_rate):
        pass

    def assign(self, id, new_id, baud_rate):
        pass

    def prepare(self, ids, current, speed):
        self.prepared |= set(ids)

    def set_torque(self, ids, on):
        self.torque |= dict.fromkeys(ids, on)

    def set_current(self, ids, current):
        pass

    def arm_watchdog(self, ids, seconds):
        if not self.has_watchdog:
            raise BusError("no watchdog")

    def send_goals(self, goals):
        self.positions |= goals

    def read_states(self, ids):
        unprepared = set(ids) - self.prepared
        if unprepared:
            raise BusError(f"servos {unprepared} were not prepared")
        return {
            id: ServoState(self.positions.get(id, 0), 0.0, 0.1, 5.0, 30.0) for id in ids
        }

    def reboot(self, id):
        pass

    def close(self):
        pass
