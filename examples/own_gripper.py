"""Your own gripper: a suction cup, which holds within 2 mm and not beyond, on a relay's output.

python examples/own_gripper.py [FOLDER]
"""

import sys

from uam_lab import Flight
from uam_sim_bridge.devices.magnet.lines import LINES, Line

# what the simulated plant needs: [gap [m], fraction of holding_force]
SUCTION = [[0.0, 1.0], [0.002, 1.0], [0.003, 0.0]]


class Relay(Line):
    """What the real vehicle needs: chip: relay:/dev/ttyUSB0 in the lab file."""

    def __init__(self, chip, number=0, active_low=False):
        self.device, self.command, self.state = chip, (b"off\n", b"on\n"), False
        self.set(False)

    def set(self, on):
        with open(self.device, "wb") as relay:
            relay.write(self.command[on])
        self.state = on

    def read(self):
        return self.state  # this relay has no answer

    def close(self):
        self.set(False)


LINES["relay"] = Relay

if __name__ == "__main__":
    options = {"out": sys.argv[1]} if len(sys.argv) > 1 else {}
    changes = {"magnet.curve": SUCTION, "magnet.holding_force": 40.0}
    with Flight(
        scenario="quick_pick", engine="direct", vehicle_changes=changes, payload_mass=0.2, **options
    ) as flight:
        found = flight.wait().metrics
    print("lifted:", found["payload_lifted"], "off its place [m]:", found["payload_place_error_m"])
