"""Parameters of a simulated vehicle, and of the laboratory in which it stands."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from uam_control.mission.scenarios.environment import HEAVIEST
from uam_control.settings.json_text import read_mapping
from uam_control.settings.parameter_set import (
    ParameterError,
    ParameterSet,
    choice,
    integer,
    number,
    switch,
    text,
    vector,
)

GPIO, AUTOPILOT, SERVO, NONE = "gpio", "autopilot", "servo", "none"
TOPIC = "topic"
TCP, LINE, NATNET = "tcp", "line", "natnet"


@dataclass(frozen=True)
class SimulatedParameters(ParameterSet):
    """The vehicle as simulated, its payload and its noise, the autopilot's port."""

    vehicle_changes: str = text(
        "{}", "dotted entries of the vehicle's file to replace", 'JSON, as {"air.gust": 1.0}'
    )
    payload_mass: float = number(0.2, "mass of the payload, 0 for none", "kg", 0.0, HEAVIEST)
    seed: int = integer(1, "seed of all noise", 0, 2**31 - 1)
    arm_start: tuple = vector(
        (),
        "joint angles on the ground, empty = stowed as described",
        "rad",
        -math.pi,
        math.pi,
        optional=True,
    )
    hil_port: int = integer(4560, "TCP port at which the autopilot connects", 1, 65535)
    statistics: str = text("", "JSON file to write at the end", "a file; empty: none")

    def changes(self) -> dict[str, Any]:
        """Return the entries to replace, for `Vehicle.changed`; raises ParameterError."""
        expected = 'vehicle_changes: JSON expected, as {"air.gust": 1.0}'
        return read_mapping(self.vehicle_changes, ParameterError, expected)


@dataclass(frozen=True)
class LaboratoryParameters(SimulatedParameters):
    """What stands in the laboratory; fixed once the node runs."""

    folder: str = text("devices", "folder of the pseudo-terminals and of `ready`", "a folder")
    hardware: str = text(
        "s500_lab", "servos of the bus", "name of a lab file, or a file with the section arm"
    )
    baud: int = integer(921600, "baud rate of the autopilot's line", 9600, 12_500_000)
    mocap_port: int = integer(1510, "its command port on 127.0.0.1", 0, 65535)
    poses: str = choice(
        NATNET,
        "how the poses come: natnet, from the emulated server; topic, from a node of its own",
        (NATNET, TOPIC),
    )
    body: str = text("uam", "rigid body of the vehicle", "its name")
    payload: str = text("", "rigid body of the payload", "its name; empty: not tracked")
    calibration: str = text(
        "motive_y_up", "axes and bodies of the cameras", "name of config/mocap, or a file"
    )
    magnet: str = choice(
        GPIO,
        "what switches the magnet: a GPIO line, or the autopilot; servo: a gripper's, on the bus",
        (GPIO, AUTOPILOT, SERVO, NONE),
    )
    magnet_line: str = text("magnet", "file that is the simulated GPIO line", "a file")
    active_low: bool = switch(False, "whether a low level of the line switches on")
    magnet_output: int = integer(1, "actuator of the autopilot that switches", 1, 6)
    magnet_on: float = number(1.0, "value of the actuator for on", "1", -1.0, 1.0)
    magnet_off: float = number(-1.0, "value of the actuator for off", "1", -1.0, 1.0)
    imu: str = choice(
        AUTOPILOT,
        "the estimator's IMU: the autopilot's, or one of the companion",
        ("autopilot", TOPIC),
    )
    hil: str = choice(
        TCP,
        "sensors and motors of the autopilot: tcp: at hil_port; line: a pseudo-terminal, as the "
        "USB of a flight controller in HITL",
        (TCP, LINE),
    )
    faults: str = text(
        "", "faults of cables with their times", "JSON, see docs/faults.md; empty: none"
    )
    person: bool = switch(True, "whether a person does the steps of the checklist")
    linger: float = number(
        1.0, "time after the mission, in which the autopilot can land and disarm", "s", 0.0, 600.0
    )
    flight_limit: float = number(
        0.0, "time after the first arming, after which the rehearsal ends, 0: never", "s", 0.0, 1e6
    )

    @property
    def places(self) -> Path:
        """Folder of the pseudo-terminals."""
        return Path(self.folder)

    @property
    def gpio(self) -> Path | None:
        """File of the simulated GPIO line, None where something else switches the magnet."""
        return Path(self.magnet_line) if self.magnet == GPIO else None
