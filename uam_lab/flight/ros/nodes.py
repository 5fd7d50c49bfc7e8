"""The processes of a flight with the ROS engine: executables, modules, autopilot arguments."""

from __future__ import annotations

from uam_lab.flight.settings import FlightSettings
from uam_lab.results.result_folder import ResultFolder
from uam_msgs_py.node import wiring
from uam_sim_bridge.ports import Ports

# Executable → module. Started and, at the end, stopped in this order, the recorder last.
MODULES = {
    wiring.RECORDER: "uam_lab.nodes.recorder",
    wiring.PLANT: "uam_sim_bridge.nodes.mujoco_sim",
    wiring.ESTIMATOR: "uam_control.nodes.state_estimator",
    wiring.MISSION: "uam_control.nodes.mission",
    wiring.POSITION: "uam_control.nodes.position_controller",
    wiring.ATTITUDE: "uam_control.nodes.attitude_controller",
    wiring.ARM: "uam_control.nodes.arm_controller",
    wiring.BRIDGE: "uam_sim_bridge.nodes.mavlink_bridge",
    wiring.SCENE: "uam_lab.nodes.scene",
    wiring.COCKPIT: "uam_lab.nodes.cockpit",
}
STAND_IN, SITL = "uam_sim_bridge.autopilot.server", "uam_sim_bridge.px4.sitl"
HITL_ROUTER = "uam_sim_bridge.mavlink.hil.router"
PX4_LOG = "px4.ulg"
AUTOPILOT_WAIT = 60.0  # [s] for which the autopilot waits for the simulator


def modules(settings: FlightSettings) -> dict[str, str]:
    """Return the nodes of a flight: executable → module."""
    return {name: module for name, module in MODULES.items() if name not in settings.without}


def in_the_loop(settings: FlightSettings) -> bool:
    """Return whether a flight controller is connected by one serial line (hardware in the loop)."""
    return settings.link is not None and settings.link.kind == "serial"


def users_autopilot(settings: FlightSettings) -> bool:
    """Return whether the user starts the autopilot, which itself connects to the plant."""
    return settings.link is not None and not in_the_loop(settings)


def autopilot(
    settings: FlightSettings, folder: ResultFolder, ports: Ports
) -> tuple[str, list[str]]:
    """Return module and arguments of the autopilot's process; "" if the user starts it."""
    instance = ["--instance", str(ports.instance)]
    patience = ["--wait", str(AUTOPILOT_WAIT)]
    vehicle = ["--vehicle", settings.vehicle.source]
    if in_the_loop(settings):
        return HITL_ROUTER, [settings.autopilot, *instance, *patience]
    if settings.px4 is not None:
        log = folder.path / PX4_LOG
        own = ["--px4-dir", str(settings.px4.directory), "--log", str(log.absolute())]
        return SITL, [*instance, *own, *vehicle]
    if users_autopilot(settings):
        return "", []
    return STAND_IN, [*instance, *patience, *vehicle]
