"""The nodes of a vehicle: modules, parameters, and who publishes what in place of the plant."""

from typing import Any

from uam_control.offboard.autopilot_magnet import NONE
from uam_control.profiles.profile import load_profile
from uam_control.vehicle import POSITION_SERVO
from uam_lab.cockpit import page_address
from uam_lab.executables import MODULES
from uam_lab.flights.flight_options import ONLOOKERS
from uam_lab.flights.flight_settings import FlightSettings
from uam_lab.flights.ros import node_arguments
from uam_lab.flights.vehicle.lab_file import AUTOPILOT, GPIO, SERVO, Lab
from uam_lab.records.results.result_folder import ResultFolder
from uam_msgs_py.messages import topics
from uam_msgs_py.node import wiring

CHECKLIST = wiring.CHECKLIST
CHECKLIST_RECORD = "checklist.json"  # in the result folder
DRIVERS = {
    name: MODULES[name] for name in (wiring.MOCAP_DRIVER, wiring.ARM_DRIVER, wiring.MAGNET_DRIVER)
}
WAITS = {"wait_for_device": True}  # of a driver
STATE_TIMEOUT = 1.0  # [s] without a state in flight, as `release_time` of the bridge


def modules(lab: Lab) -> dict[str, str]:
    """Return the nodes of a vehicle: executable → module, in the order of the start."""
    absent = {wiring.PLANT, wiring.SCENE}
    stack = {name: one for name, one in node_arguments.MODULES.items() if name not in absent}
    drivers = dict(DRIVERS)
    if lab.mocap is None:
        del drivers[wiring.MOCAP_DRIVER]
    if lab.magnet.through != GPIO:
        del drivers[wiring.MAGNET_DRIVER]
    recorder = {wiring.RECORDER: stack.pop(wiring.RECORDER)}
    return recorder | drivers | stack | {CHECKLIST: MODULES[CHECKLIST]}


def processes(lab: Lab) -> dict[str, str]:
    """Return the processes of a vehicle, in the order of the start."""
    whole = bool(lab.profile) and load_profile(*lab.profile, vehicle=lab.vehicle).whole
    return node_arguments.arranged(modules(lab), lab.fused, whole)


def parameters(
    lab: Lab, settings: FlightSettings, folder: ResultFolder
) -> dict[str, dict[str, Any]]:
    """Return the parameters of each node of `modules`. Raises AddressError."""
    sections = node_arguments.flight_nodes(settings, folder)
    sections[wiring.RECORDER] |= {"simulated": False}
    sections[wiring.MISSION] |= {"state_timeout": STATE_TIMEOUT}
    sections[wiring.BRIDGE] |= WAITS | {
        "autopilot": lab.autopilot,
        "autopilot_system": lab.autopilot_system,
        "imu_clock": "system",
    }
    switching = lab.magnet.switching.to_mapping()
    if lab.magnet.through == AUTOPILOT:
        sections[wiring.BRIDGE] |= lab.magnet.output.to_mapping() | switching
    host = lab.cockpit.address
    port = page_address.free_port(host, lab.cockpit.port)
    results = str(folder.path.absolute())
    sections[wiring.COCKPIT] = {"host": host, "port": port, "results": results}
    sections[wiring.ARM_DRIVER] = WAITS | {
        "hardware": str(lab.arm_file.absolute()),
        "device": lab.arm.device,
        "vehicle": settings.vehicle.source,
    }
    if lab.mocap is not None:
        sections[wiring.MOCAP_DRIVER] = WAITS | lab.mocap.to_mapping()
    if lab.magnet.through == GPIO:
        sections[wiring.MAGNET_DRIVER] = WAITS | lab.magnet.line.to_mapping() | switching
    own = {key: value for key, value in lab.process.items() if key != "busy_poll"}
    for node in DRIVERS.keys() & sections.keys():  # in the loop as the nodes behind them
        sections[node] |= own
    sections[CHECKLIST] = _checklist(lab, settings, folder)
    sections[wiring.MISSION]["require_checklist"] = True
    for node in (wiring.ARM_DRIVER, CHECKLIST):
        sections[node] |= lab.nodes.get(node, {})
    return node_arguments.complete(sections, settings, folder)


def _checklist(lab: Lab, settings: FlightSettings, folder: ResultFolder) -> dict[str, Any]:
    displays = (*ONLOOKERS, CHECKLIST)
    return {
        "nodes": ",".join(name for name in modules(lab) if name not in displays),
        "record": str((folder.path / CHECKLIST_RECORD).absolute()),
        "recordings": str(folder.path.absolute()),
        "room_low": list(lab.room.low),
        "room_high": list(lab.room.high),
        "magnet": lab.magnet.through != NONE,
        "vehicle": settings.vehicle.source,
    }


def sources(lab: Lab) -> dict[str, str]:
    """Return topic of the plant → node that publishes it on this vehicle.

    Topics that another driver of the user publishes are missing.
    """
    found = {topics.JOINTS.name: wiring.ARM_DRIVER}
    if lab.imu == AUTOPILOT:
        found[topics.IMU.name] = wiring.BRIDGE
    if lab.mocap is not None:
        found[topics.MOCAP.name] = wiring.MOCAP_DRIVER
        if lab.mocap.payload:
            found[topics.PAYLOAD.name] = wiring.MOCAP_DRIVER
    return found


def publishers(lab: Lab) -> str:
    """Return the parameter `publishers` of every node."""
    return ",".join(f"{topic}={node}" for topic, node in sources(lab).items())


def wires(lab: Lab) -> list[wiring.Wire]:
    goals = lab.vehicle.numbers["servos"]["mode"] == POSITION_SERVO
    commands = topics.ARM_GOALS if goals else topics.ARM_EFFORT
    subscribers = {commands.name: wiring.ARM_DRIVER}
    if lab.magnet.through == GPIO:
        subscribers[topics.MAGNET.name] = wiring.MAGNET_DRIVER
    elif lab.magnet.through == SERVO:
        subscribers[topics.MAGNET.name] = wiring.ARM_DRIVER
    elif lab.magnet.through == AUTOPILOT:
        subscribers[topics.MAGNET.name] = wiring.BRIDGE
    return wiring.on_vehicle(sources(lab), subscribers)
