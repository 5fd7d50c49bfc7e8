"""Parameters of plant node and laboratory as declared, and statistics of the former."""

from __future__ import annotations

from array import array
from dataclasses import asdict, dataclass, field, replace

from rclpy.node import Node

from uam_control.coordinates import ARM
from uam_control.nodes.described import described_vehicle
from uam_control.settings.parameter_set import (
    choice,
    number,
    switch,
    text,
)
from uam_control.settings.process_parameters import TickTimesParameters
from uam_control.vehicle import VehicleDescription
from uam_msgs_py.node.node_parameters import NodeParameters
from uam_msgs_py.node.rightful import RightfulNodes, rightful_nodes
from uam_sim_bridge.laboratory.laboratory_parameters import (
    LaboratoryParameters,
    SimulatedParameters,
)
from uam_sim_bridge.mavlink.hil.sitl_ports import HOST
from uam_sim_bridge.plant.engines import DEFAULT_PLANT, PLANTS

NOT_READY = 3  # exit status: not every node has started, or not all are connected


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


def declare_laboratory(node: Node) -> tuple[VehicleDescription, LaboratoryParameters]:
    """Declare the parameters; return vehicle and values. Raises ParameterError."""
    vehicle = described_vehicle(node)
    rightful_nodes(node)  # declares `publishers`, which every node of a flight has
    joints = vehicle.coordinates[ARM]
    return vehicle, NodeParameters(node, LaboratoryParameters, joints, read_only=True).current
