"""Parameters of the plant node, and the statistics that it writes at its end."""

from __future__ import annotations

from array import array
from dataclasses import asdict, dataclass, field, replace

from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node

from uam_control.settings.parameter_set import ParameterError
from uam_control.vehicle import DEFAULT_VEHICLE
from uam_sim_bridge.plant.engines import DEFAULT_PLANT, PLANTS

NOT_READY = 3  # exit status: not every node has started, or not all are connected


@dataclass(frozen=True)
class Options:
    """The node's parameters."""

    vehicle: str = DEFAULT_VEHICLE
    vehicle_changes: str = "{}"
    plant: str = DEFAULT_PLANT
    payload_mass: float = 0.2
    seed: int = 1
    arm_start: list[float] = field(default_factory=list)
    clock: str = "lockstep"
    hil_port: int = 4560
    autopilot_always_answers: bool = True
    linger: float = 0.0
    recorded: bool = False
    foreign: str = ""
    faults: str = ""
    start_timeout: float = 0.0
    answer_timeout: float = 10.0
    time_limit: float = 0.0
    statistics: str = ""


DESCRIPTIONS = {
    "vehicle": "name of a file in config/vehicle",
    "vehicle_changes": 'JSON, dotted entries of that file to replace, as {"air.gust": 1.0}',
    "plant": "physics engine: " + ", ".join(PLANTS) + ", or a class as module:Class",
    "payload_mass": "mass of the payload [kg], 0 for none",
    "seed": "of all noise",
    "arm_start": "joint angles on the ground [rad], empty = stowed as described",
    "clock": "lockstep or realtime",
    "hil_port": "TCP port at which the autopilot connects",
    "autopilot_always_answers": "true for the stand-in; false for PX4, which is silent at boot",
    "linger": "time after the mission, in which the autopilot can land and disarm [s]",
    "recorded": "wait for the recorder as well",
    "foreign": "names of nodes that are not the stack's own, with commas between them",
    "faults": "JSON, faults of the plant with their times, see docs/faults.md; empty = none",
    "start_timeout": "longest wait for the other nodes [s] without progress, 0 = for ever",
    "answer_timeout": "longest wait for the answers to a tick [s of wall time]",
    "time_limit": "simulation time at which the flight ends in any case [s], 0 = never",
    "statistics": "JSON file to write at the end, empty = none",
}


def declare(node: Node) -> Options:
    """Declare the parameters and return their values. Raises ParameterError for a bad one."""
    values = {}
    for name, default in asdict(Options()).items():
        text = ParameterDescriptor(
            description=DESCRIPTIONS[name], read_only=True, dynamic_typing=default == []
        )
        values[name] = node.declare_parameter(name, default, text).value
    options = Options(**values)
    if options.clock not in ("lockstep", "realtime"):
        raise ParameterError(f"clock: '{options.clock}' is not lockstep or realtime")
    return options


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
