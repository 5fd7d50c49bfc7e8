"""The devices of a vehicle as the diagnostics of the nodes report them.

For each: whether it is there, else what is missing and how to check it.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial

from uam_control.offboard.autopilot_magnet import ACTUATOR
from uam_lab.flights.observer import STARTING, DeviceState
from uam_lab.flights.vehicle.lab_file import AUTOPILOT, GPIO, Lab
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.status import ERROR, STALE
from uam_msgs_py.node import wiring
from uam_sim_bridge.devices.mocap.mocap_parameters import NATNET
from uam_sim_bridge.mavlink.transport.transport import parse_url

RECENT = 1500.0  # [ms] age up to which a sensor counts as present: reports come once a second


@dataclass(frozen=True)
class Report:
    """The newest diagnostics of a node."""

    level: bytes
    message: str
    values: Mapping[str, str] = field(default_factory=dict)


Reports = Mapping[str, Report]


@dataclass(frozen=True)
class Device:
    """One device."""

    name: str
    advice: str  # how to check it
    node: str  # that reports it
    found: Callable[[Report], tuple[bool, str]]  # by the report, whether it is there, and text

    def state(self, reports: Reports) -> DeviceState:
        """Return the state of the device by the reports of the nodes: name → report."""
        report = reports.get(self.node)
        present, text = (False, STARTING) if report is None else self.found(report)
        return DeviceState(self.name, present, text, self.advice)


def devices(lab: Lab) -> list[Device]:
    """Return the devices of a lab file, each once."""
    arm = f"supply of the servos; ls -l /dev/serial/by-id; uam arm --config {lab.file}"
    return [
        _mocap(lab),
        Device("arm", arm, wiring.ARM_DRIVER, _driven),
        *([_magnet(lab)] if lab.magnet.through in (GPIO, AUTOPILOT) else []),
        Device("autopilot", _autopilot_advice(lab), wiring.BRIDGE, partial(_autopilot, lab)),
        Device("imu", _imu_advice(lab), wiring.ESTIMATOR, partial(_sensor, topics.IMU)),
    ]


def _mocap(lab: Lab) -> Device:
    if lab.mocap is None:
        topic = f"/{topics.MOCAP.name}"
        text = f"ros2 topic hz {topic} in the domain of this flight; is your driver in it?"
        return Device("motion capture", text, wiring.ESTIMATOR, partial(_sensor, topics.MOCAP))
    m = lab.mocap
    text = f"ping {m.server}"
    if m.source == NATNET:
        text += "; Motive: Data Streaming, NatNet on, Local Interface not loopback"
    text += f"; uam calibrate-mocap --config {lab.file} lists bodies"
    return Device("motion capture", text, wiring.MOCAP_DRIVER, _driven)


def _magnet(lab: Lab) -> Device:
    if lab.magnet.through == GPIO:
        line = lab.magnet.line
        text = f"gpiodetect; gpioinfo; ls -l {line.chip}: group gpio?"
        return Device("magnet", text, wiring.MAGNET_DRIVER, _driven)
    if lab.magnet.output.magnet == ACTUATOR:
        output = f"Peripheral via Actuator Set {lab.magnet.output.magnet_output}"
        text = f"QGroundControl, Actuators: {output}"
    else:
        text = "QGroundControl, Actuators: Gripper; PX4: PD_GRIPPER_TYPE 0"
    return Device("magnet", text, wiring.BRIDGE, _autopilots_magnet)


def _autopilots_magnet(report: Report) -> tuple[bool, str]:
    state = report.values.get("magnet", "")
    on = {"True": "on", "False": "off"}.get(state)
    return (False, "no acknowledgement of the autopilot") if on is None else (True, on)


def _autopilot_advice(lab: Lab) -> str:
    link = parse_url(lab.autopilot)
    text = f"uam doctor --autopilot {lab.autopilot}"
    if link.kind == "serial":
        return (
            f"{text}; ls -l /dev/serial/by-id; PX4: MAV_1_CONFIG 102, SER_TEL2_BAUD {link.number}"
        )
    return f"{text}; ping {link.place}"


def _imu_advice(lab: Lab) -> str:
    if lab.imu == AUTOPILOT:
        return "comes with the autopilot's link; the rest: docs/autopilot.md"
    return f"ros2 topic hz /{topics.IMU.name} in the domain of this flight; is your driver in it?"


def _driven(report: Report) -> tuple[bool, str]:
    """Return whether a driver has its device: it reports an error without."""
    return report.level != ERROR, "open" if report.level == STALE else report.message


def _sensor(topic: topics.Topic, report: Report) -> tuple[bool, str]:
    """Return whether the estimator receives a topic."""
    known = [text for key, text in report.values.items() if key.endswith(f"/{topic.name} [ms]")]
    age = float(known[0]) if known and known[0] else None
    if age is None:
        return False, f"no message on /{topic.name}"
    if age > RECENT:
        return False, f"no message on /{topic.name} for {1e-3 * age:.0f} s"
    return True, f"messages on /{topic.name}"


def _autopilot(lab: Lab, report: Report) -> tuple[bool, str]:
    if report.values.get("heartbeat") == "True":
        text = f"mode {report.values.get('autopilot mode', '')}"
        return True, text if report.level == STALE else f"{text}; {report.message}"
    if report.values.get("link open") == "False":
        return False, f"{lab.autopilot}: cannot be opened; is it plugged in?"
    text = f"{lab.autopilot}: no heartbeat"
    if other := report.values.get("other autopilots"):
        text += f" of system {lab.autopilot_system}, but of {other}: see autopilot_system"
    return False, text
