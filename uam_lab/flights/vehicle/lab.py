"""What a lab file describes: vehicle, flight, room and devices of one laboratory."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from uam_control.offboard.autopilot_magnet import NONE, AutopilotMagnetParameters
from uam_control.vehicle import VehicleDescription
from uam_lab.cockpit.page_address import LOCAL, PORT
from uam_sim_bridge.devices.dynamixel.chain import ArmChain
from uam_sim_bridge.devices.magnet.lines import LineParameters, SwitchingParameters
from uam_sim_bridge.devices.mocap.mocap_parameters import MocapParameters

AUTOPILOT, TOPIC, GPIO = "autopilot", "topic", "gpio"
SERVO = "servo"  # a gripper's, on the arm's bus
IMUS = (AUTOPILOT, TOPIC)
THROUGH = (GPIO, AUTOPILOT, SERVO, NONE)
OUT = Path("flights")


class LabError(ValueError):
    """A lab file that cannot be used; the text is one line: file, entry, what is allowed."""


@dataclass(frozen=True)
class Room:
    """The geofence: corners (3,) [m, ENU], low below high in each axis."""

    low: tuple[float, float, float]
    high: tuple[float, float, float]


@dataclass(frozen=True)
class Magnet:
    """through: one of THROUGH; line: its GPIO line; output: that of the autopilot."""

    through: str
    line: LineParameters = LineParameters()
    output: AutopilotMagnetParameters = AutopilotMagnetParameters()
    switching: SwitchingParameters = SwitchingParameters()


@dataclass(frozen=True)
class Page:
    """Address and first port of the cockpit."""

    address: str = LOCAL
    port: int = PORT


@dataclass(frozen=True)
class Lab:
    """A checked lab file.

    profile: names or files, () for the vehicle's own; scenario: name or file; autopilot: URL of its
    link; imu: one of IMUS; mocap: None where another driver publishes the poses; arm: its servos,
    arm_file: the file with them; nodes: node → parameter → value, beside those of the sections;
    out: folder of the result folders; process: parameters of `ProcessParameters` of the nodes that
    fly; fused: the control nodes are one process; gcs: URL of a ground station behind the bridge;
    autopilot_system: MAVLink system id, PX4's MAV_SYS_ID.
    """

    file: Path
    vehicle: VehicleDescription
    profile: tuple[str, ...]
    scenario: str
    autopilot: str
    imu: str
    room: Room
    mocap: MocapParameters | None
    arm: ArmChain
    arm_file: Path
    magnet: Magnet
    cockpit: Page = Page()
    nodes: dict[str, dict[str, Any]] = field(default_factory=dict)
    out: Path = OUT
    process: dict[str, Any] = field(default_factory=dict)
    fused: bool = False
    gcs: str = ""
    autopilot_system: int = 1
