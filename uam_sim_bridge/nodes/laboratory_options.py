"""Parameters of the laboratory node, and the devices that they describe."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from rclpy.node import Node

from uam_control.coordinates import ARM
from uam_control.nodes.described import described_vehicle
from uam_control.settings.configuration import ConfigurationError
from uam_control.settings.parameter_set import (
    ParameterError,
    choice,
    integer,
    number,
    switch,
    text,
)
from uam_control.vehicle import VehicleDescription
from uam_msgs_py.node.node_parameters import NodeParameters
from uam_msgs_py.node.rightful import rightful_nodes
from uam_sim_bridge.devices.dynamixel.chain import hardware_file, load_chain
from uam_sim_bridge.devices.mocap import calibration
from uam_sim_bridge.laboratory.laboratory import Devices
from uam_sim_bridge.nodes.plant_options import SimulatedParameters

GPIO, AUTOPILOT, SERVO, NONE = "gpio", "autopilot", "servo", "none"
TOPIC = "topic"
TCP, LINE, NATNET = "tcp", "line", "natnet"


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


def declare(node: Node) -> tuple[VehicleDescription, LaboratoryParameters]:
    """Declare the parameters; return vehicle and values. Raises ParameterError."""
    vehicle = described_vehicle(node)
    rightful_nodes(node)  # declares `publishers`, which every node of a flight has
    joints = vehicle.coordinates[ARM]
    return vehicle, NodeParameters(node, LaboratoryParameters, joints, read_only=True).current


def devices(vehicle: VehicleDescription, p: LaboratoryParameters) -> Devices:
    """Return the described devices. Raises ParameterError, ArmError, MocapError."""
    try:
        chain = load_chain(hardware_file(p.hardware), vehicle)
        calibrated = calibration.load(p.calibration)
    except ConfigurationError as error:
        raise ParameterError(str(error)) from None
    return Devices(
        folder=Path(p.folder),
        chain=chain,
        baud=p.baud,
        body=p.body,
        payload=p.payload,
        calibration=calibrated,
        mocap_port=p.mocap_port,
        magnet_line=Path(p.magnet_line) if p.magnet == GPIO else None,
        active_low=p.active_low,
        magnet_output=p.magnet_output,
        magnet_on=p.magnet_on,
        magnet_off=p.magnet_off,
        usb=p.hil == LINE,
    )
