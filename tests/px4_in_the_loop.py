"""PX4 built without lockstep as a flight controller in HITL: own clock, a serial line."""

import os
import signal
import subprocess
import sys
from pathlib import Path

from uam_sim_bridge.px4.px4_installation import Px4Error, Px4Installation

VARIABLE = "PX4_HITL_DIR"
NO_PX4 = f"no PX4 for the loop: set {VARIABLE} to a build of PX4 v1.16 SITL without lockstep"
PATIENCE = 10.0  # [s] for its end
BAUD = 921600


def installation() -> Px4Installation | None:
    """The build that the environment names, None where there is none."""
    try:
        return Px4Installation.find(os.environ[VARIABLE])
    except (KeyError, Px4Error):
        return None


class FlightController:
    """`px4_hitl` on the line `device`, which carries companion and simulator; `end` stops it."""

    def __init__(self, found: Px4Installation, folder: Path, device: str, instance: int = 40):
        folder.mkdir(parents=True)
        self._process = subprocess.Popen(
            [
                *(sys.executable, "-m", "uam_sim_bridge.px4.hitl", "-i", f"{instance}"),
                *("--px4-dir", str(found.directory), "--companion", f"{device}:{BAUD}"),
                *("--log", str(folder / "px4.ulg")),
            ],
            stdout=(folder / "output").open("w"),
            stderr=subprocess.STDOUT,
        )

    def end(self):
        self._process.send_signal(signal.SIGINT)
        try:
            self._process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
