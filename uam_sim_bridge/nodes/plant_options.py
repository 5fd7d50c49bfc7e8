"""Parameters of plant node and laboratory, devices of the latter, statistics of the former."""

from __future__ import annotations

import math
from array import array
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from rclpy.node import Node

from uam_control.coordinates import ARM
from uam_control.mission.scenarios.environment import HEAVIEST
from uam_control.nodes.described import described_vehicle
from uam_control.settings.configuration import ConfigurationError
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
from uam_control.settings.process_parameters import TickTimesParameters
from uam_control.vehicle import VehicleDescription
from uam_msgs_py.node.node_parameters import NodeParameters
from uam_msgs_py.node.rightful import RightfulNodes, rightful_nodes
from uam_sim_bridge.devices.dynamixel.chain import hardware_file, load_chain
from uam_sim_bridge.devices.mocap import calibration
from uam_sim_bridge.laboratory.laboratory import Devices
from uam_sim_bridge.mavlink.hil.sitl_ports import HOST
from uam_sim_bridge.plant.engines import DEFAULT_PLANT, PLANTS

NOT_READY = 3  # exit status: not every node has started, or not all are connected
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
class PlantParameters(SimulatedParameters):
    """Parameters of the plant node; they cannot change while it runs."""

    plant: str = text(
        DEFAULT_PLANT, "physics engine", ", ".join(PLANTS) + ", or a class as module:Class"
    )
    plant_preset: str = text(
        "", "effects of the plant", "names or files of config/plant with commas; empty: calm"
    )
    clock: str = choice(
        "lockstep",
        "lockstep: each tick waits for all answers; realtime: ticks of the wall clock",
        ("lockstep", "realtime"),
    )
    let_go: float = number(
        0.0,
        "real time: lateness from which time is let go, for an autopilot with its own clock; 0: "
        "never, all of it is caught up",
        "s",
        0.0,
        10.0,
    )
    publish_imu: bool = switch(
        True, "publish the companion's IMU; false: mavlink_bridge publishes the autopilot's"
    )
    hil_address: str = text(
        HOST, "address of this machine at which the autopilot connects", "IPv4; 0.0.0.0: any"
    )
    autopilot_always_answers: bool = switch(
        True, "true for the stand-in; false for PX4, which is silent at boot"
    )
    linger: float = number(
        0.0, "time after the mission, in which the autopilot can land and disarm", "s", 0.0, 600.0
    )
    end_with_mission: bool = switch(
        False, "end the node with the mission or a lost node; false: wait for the next flight"
    )
    recorded: bool = switch(False, "wait for the recorder as well")
    foreign: str = text(
        "",
        "nodes of the stack that the user replaces, with the names of the own ones",
        "NODE=NAME with commas between; empty: none",
    )
    faults: str = text(
        "", "faults of the plant with their times", "JSON, see docs/faults.md; empty: none"
    )
    start_timeout: float = number(
        0.0, "longest wait for the other nodes without progress, 0 = for ever", "s", 0.0, 86400.0
    )
    answer_timeout: float = number(
        10.0,
        "longest wait for the answers to a tick, of wall time; 0: until every node has reported in "
        "/diagnostics ten times since",
        "s",
        0.0,
        3600.0,
    )
    time_limit: float = number(
        0.0, "simulation time at which the flight ends in any case, 0 = never", "s", 0.0, 1e6
    )


@dataclass(frozen=True)
class Options:
    """The vehicle, the parameters of the plant node, and who may publish its inputs."""

    vehicle: VehicleDescription
    parameters: PlantParameters
    rightful: RightfulNodes
    tick_times: TickTimesParameters


def declare(node: Node) -> Options:
    """Declare the parameters and return their values. Raises ParameterError for a bad one."""
    vehicle = described_vehicle(node)
    joints = vehicle.coordinates[ARM]
    declared = NodeParameters(node, PlantParameters, joints, read_only=True).current
    times = NodeParameters(node, TickTimesParameters, read_only=True).current
    return Options(vehicle, declared, rightful_nodes(node), times)


@dataclass
class Statistics:
    """Statistics of the flight, written at the end."""

    clock: str
    ticks: int = 0
    simulated_s: float = 0.0
    wall_s: float = 0.0
    answerable_ticks: int = 0  # realtime: ticks with an IMU sample, which require a setpoint
    missed_ticks: int = 0
    late_ticks: int = 0
    late_motor_commands: int = 0
    latency_s: array[float] = field(default_factory=lambda: array("f"))  # 4 bytes: long flights
    ended_by: str = ""

    def to_mapping(self) -> dict[str, object]:
        """Return the values for JSON; latencies rounded to the microsecond."""
        latencies = [round(value, 6) for value in self.latency_s]
        return asdict(replace(self, latency_s=array("f"))) | {"latency_s": latencies}


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


def declare_laboratory(node: Node) -> tuple[VehicleDescription, LaboratoryParameters]:
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
