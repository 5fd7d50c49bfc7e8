"""PX4 built without lockstep as a flight controller in HITL: own clock, a serial line."""

import os
import signal
import subprocess
from pathlib import Path

from uam_control.vehicle import load_description
from uam_sim_bridge.px4 import px4_parameters
from uam_sim_bridge.px4.px4_installation import Px4Error, Px4Installation

VARIABLE = "PX4_HITL_DIR"
NO_PX4 = f"no PX4 for the loop: set {VARIABLE} to a build of PX4 v1.16 SITL without lockstep"
PATIENCE = 5.0  # [s] for its end
BAUD, RATE = 921600, 60000  # baud; bytes/s that PX4 sends at most


def installation() -> Px4Installation | None:
    """The build that the environment names, None where there is none."""
    try:
        return Px4Installation.find(os.environ[VARIABLE])
    except (KeyError, Px4Error):
        return None


class FlightController:
    """PX4 in the folder `folder` on the line `device`; `end` stops it."""

    def __init__(self, found: Px4Installation, folder: Path, device: str, instance: int = 40):
        values = px4_parameters.load(load_description())
        kept = {name: value for name, value in values.items() if not name.startswith("SIM_")}
        kept |= {"SYS_HITL": 1, "MAV_SYS_ID": 1, "IMU_INTEG_RATE": 250, "SIM_BAT_ENABLE": 0}
        kept |= {f"HIL_ACT_FUNC{motor}": 100 + motor for motor in range(1, 5)}
        scripts = folder / "scripts"
        scripts.mkdir(parents=True)
        # in place of PX4's scripts: no simulator at TCP, sensors and commander for HITL
        (scripts / px4_parameters.STARTED_LATE).write_text(
            "".join(
                f"param set {name} {value}\n"
                for name, value in kept.items()
                if name != px4_parameters.AIRFRAME
            )
            + "unalias sensors commander\n"
            "sensors() { px4-sensors --instance $px4_instance start -h; }\n"
            "commander() { px4-commander --instance $px4_instance start -h; }\n"
            "px4-pwm_out_sim --instance $px4_instance start -m hil\n"
        )
        (scripts / "px4-rc.mavlink").write_text(
            f"mavlink start -d {device} -b {BAUD} -m onboard -r {RATE}\n"
        )
        self._process = subprocess.Popen(
            [str(found.binary), "-i", f"{instance}", "-d", str(found.etc)],
            cwd=folder,
            env={name: value for name, value in os.environ.items() if not name.startswith("PX4_")}
            | {"PATH": f"{scripts}:{os.environ['PATH']}"}
            | px4_parameters.environment(values),
            stdin=subprocess.DEVNULL,
            stdout=(folder / "output").open("w"),
            stderr=subprocess.STDOUT,
            process_group=0,
        )

    def end(self):
        self._process.send_signal(signal.SIGINT)
        try:
            self._process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
