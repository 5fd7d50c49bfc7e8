"""Your own autopilot firmware: ArduCopter's numbers of modes and plain integers, on the stand-in.

python examples/own_firmware.py [FOLDER]
"""

import sys
import tempfile
from pathlib import Path

from uam_control.offboard.firmware import FIRMWARES, Firmware
from uam_lab import Flight

FIRMWARE = """
label: ArduPilot
autopilot: 3
integers_as_bytes: false
modes: {STABILIZED: 0, ACRO: 1, ALTITUDE: 2, OFFBOARD: 4, HOLD: 5, RETURN: 6, LAND: 9, POSITION: 16}
"""
ADVICE = """
'prearm: gyros not calibrated': "let the vehicle rest for a minute"
'no offboard': "GUIDED needs a stream of setpoints: see the bridge's rate"
"""

if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "firmware.yaml").write_text(FIRMWARE)
        (Path(folder) / "advice.yaml").write_text(ADVICE)
        FIRMWARES["ardupilot"] = Firmware(Path(folder))
        options = {"out": sys.argv[1]} if len(sys.argv) > 1 else {}
        bridge = {"mavlink_bridge": {"firmware": "ardupilot"}}
        with Flight(scenario="hover", engine="direct", parameters=bridge, **options) as flight:
            print("completed:", flight.wait().completed)
