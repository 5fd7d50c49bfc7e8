"""Parameters of the plant node."""

from dataclasses import dataclass

from uam_control.settings.parameter_set import choice, number, switch, text
from uam_sim_bridge.laboratory.laboratory_parameters import SimulatedParameters
from uam_sim_bridge.mavlink.hil.sitl_ports import HOST
from uam_sim_bridge.plant.plant import DEFAULT_PLANT, PLANTS

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
