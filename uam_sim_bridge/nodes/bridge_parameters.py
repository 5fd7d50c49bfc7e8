"""All parameters of the bridge: those of its node, and of the objects in it."""

from dataclasses import dataclass

from uam_control.ages import STALE
from uam_control.estimation.pose_anchor import PoseSourceParameters
from uam_control.offboard.autopilot_magnet import AutopilotMagnetParameters
from uam_control.offboard.offboard_parameters import OffboardParameters
from uam_control.profiles.profile import BRIDGE, Profile
from uam_control.setpoints.level_hold import HoldParameters
from uam_control.setpoints.rate_thrust_map import RateThrustParameters
from uam_control.setpoints.setpoint_types import SetpointParameters
from uam_control.setpoints.thrust_identification import ThrustIdentificationParameters
from uam_control.settings.parameter_file import ProfileError
from uam_control.settings.parameter_set import ParameterSet, choice, integer, number, switch, text
from uam_control.settings.process_parameters import (
    DeviceWait,
    ProcessParameters,
    TickTimesParameters,
)
from uam_control.settings.texts import unknown
from uam_control.stages.vision_pacing import VisionParameters
from uam_sim_bridge.devices.magnet.lines import SwitchingParameters
from uam_sim_bridge.mavlink.telemetry.required_parameters import VEHICLE

AUTO, NONE = "auto", "none"  # values of required_parameters


@dataclass(frozen=True)
class BridgeParameters(DeviceWait):
    """Links, ports and times of the bridge; they cannot change while the node runs."""

    clock: str = choice(
        "lockstep",
        "lockstep: only ticks; realtime: also a watchdog on wall time",
        ("lockstep", "realtime"),
    )
    local_port: int = integer(14540, "own UDP port (14540 + instance)", 1, 65535)
    autopilot_port: int = integer(14580, "UDP port of the autopilot (14580 + instance)", 1, 65535)
    autopilot_system: int = integer(1, "MAVLink system id of the autopilot", 1, 255)
    signing_link_id: int = integer(0, "number of this link in MAVLink 2 signatures", 0, 255)
    autopilot_parameters: str = choice(
        "warn",
        "where the autopilot's MC_*RATE_P/K or THR_MDL_FAC differ from the mapping: warn, "
        "or adopt them before arming",
        ("warn", "adopt"),
    )
    set_parameters: bool = switch(
        False,
        "write the required parameters with one allowed value to the autopilot before it is armed; "
        "for an autopilot in software only",
    )
    dry_run: bool = switch(
        False, "compute and publish setpoints; send the autopilot none, and never arm it"
    )
    kill_confirmation: float = number(
        3.0, "time within which the second call of /mission/kill must come", "s", 0.5, 30.0
    )
    imu_source: str = choice(
        "topic",
        "IMU of the estimator: topic, from another node; autopilot: this node requests it from the "
        "autopilot and publishes it",
        ("topic", "autopilot"),
    )
    imu_clock: str = choice(
        "system",
        "clock of the stamps of the autopilot's IMU: system, or topic: /clock of a simulator",
        ("system", "topic"),
    )
    stale_after: float = number(
        STALE, "time without a command after which commands count as lost", "s", 0.01, 5.0
    )
    autopilot_host: str = text(
        *("127.0.0.1", "host of the autopilot's UDP port, used if `autopilot` is empty"),
        "name or address",
    )
    autopilot: str = text(
        *("", "link to the autopilot, in place of the UDP port"),
        "udp:HOST:PORT[:LOCAL_PORT], tcp:HOST:PORT or serial:DEVICE:BAUD; empty: none",
    )
    gcs: str = text("", "link to a ground station", "udp:HOST:PORT[:LOCAL_PORT]; empty: none")
    signing_key: str = text(
        *("", "MAVLink 2 signing; shown as 'set'", "64 hex digits, or a file with them"),
        secret=True,
    )
    required_parameters: str = text(
        *(AUTO, "parameters of the autopilot to compare and report; none is written"),
        f"a list of config/px4, as {VEHICLE}, or a YAML file; {NONE}; {AUTO}: {VEHICLE} on a "
        f"serial line or for another host, else {NONE}",
    )
    faults: str = text(
        *("", "faults of the MAVLink connection with their times"),
        "JSON, see docs/faults.md; empty: none",
    )
    network_delay: str = text(
        *("", "simulated delay of the messages to the autopilot"),
        'JSON, {"fixed", "jitter", "longest" [s], "seed"}: docs/plant.md; empty: none',
    )


KINDS: tuple[type[ParameterSet], ...] = (
    *(BridgeParameters, OffboardParameters, VisionParameters, HoldParameters),
    *(RateThrustParameters, SetpointParameters, ThrustIdentificationParameters),
    *(AutopilotMagnetParameters, SwitchingParameters, ProcessParameters, TickTimesParameters),
    PoseSourceParameters,
)
EVERY_NODE = ("vehicle", "publishers", "use_sim_time")
NAMES = {*EVERY_NODE, *(name for kind in KINDS for name in kind.specs())}


def check_names(profile: Profile) -> None:
    """Raise ProfileError for a name in a profile's section of the bridge that is no parameter."""
    for name in profile.section(BRIDGE):
        if name not in NAMES:
            raise ProfileError(f"{profile.file}: {BRIDGE}: {name}: {unknown(name, sorted(NAMES))}")
