"""The lab file: one laboratory's vehicle, room and devices. Template: config/lab/s500_lab.yaml.

Names of files in a lab file are relative to it, those of config/ need no folder.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from uam_control.laws import catalogue
from uam_control.mission import ScenarioError
from uam_control.offboard.autopilot_magnet import NONE, AutopilotMagnetParameters
from uam_control.profiles.profile import BRIDGE, NODES, ProfileError, load_profile, servo_mode
from uam_control.settings import configuration
from uam_control.settings.configuration import ConfigurationError
from uam_control.settings.parameter_set import ParameterError, ParameterSet
from uam_control.settings.process_parameters import ProcessParameters
from uam_control.settings.section import Section, read_section
from uam_control.vehicle import VehicleDescription, VehicleError, load_description
from uam_lab.cockpit.page_address import LOCAL, PORT
from uam_lab.flights import flight_settings
from uam_lab.flights.flight_settings import FlightSettings
from uam_lab.flights.node_options import FLIGHT_CONTROLLER, SettingsError
from uam_lab.flights.vehicle.checklist_parameters import check_checklist
from uam_sim_bridge.devices.dynamixel.chain import ArmChain, ArmError, chain_file, load_chain
from uam_sim_bridge.devices.dynamixel.parameters import ArmDriverParameters
from uam_sim_bridge.devices.magnet.lines import LineParameters, SwitchingParameters
from uam_sim_bridge.devices.mocap import calibration
from uam_sim_bridge.devices.mocap.frame import MocapError
from uam_sim_bridge.devices.mocap.mocap_parameters import MocapParameters
from uam_sim_bridge.mavlink.transport.transport import ALLOWED, parse_url
from uam_sim_bridge.ports import PortError

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
    """A checked lab file."""

    file: Path
    vehicle: VehicleDescription
    profile: tuple[str, ...]  # names or files, () for the vehicle's own
    scenario: str  # name or file
    autopilot: str  # URL of its link
    imu: str  # one of IMUS
    room: Room
    mocap: MocapParameters | None  # None where another driver publishes the poses
    arm: ArmChain  # its servos
    arm_file: Path  # the file with them
    magnet: Magnet
    cockpit: Page = Page()
    nodes: dict[str, dict[str, Any]] = field(default_factory=dict)  # further parameters of nodes
    out: Path = OUT  # folder of the result folders
    process: dict[str, Any] = field(default_factory=dict)  # `ProcessParameters` of nodes that fly
    fused: bool = False  # the control nodes are one process
    gcs: str = ""  # URL of a ground station behind the bridge
    autopilot_system: int = 1  # MAVLink system id, PX4's MAV_SYS_ID


SHARED = (
    *NODES,
    BRIDGE,
    "recorder",
    "cockpit",
    FLIGHT_CONTROLLER,
)  # nodes that a flight in simulation has, too
FOLDER, TEMPLATE = "lab", "s500_lab"
REQUIRED = ("vehicle", "scenario", "autopilot", "imu", "room", "mocap", "arm", "magnet")
OPTIONAL = ("profile", "cockpit", "nodes", "out", "process", "layout", "gcs", "autopilot_system")
SEPARATE, FUSED = LAYOUTS = ("separate", "fused")
LAST_SYSTEM = 250  # of PX4's MAV_SYS_ID
GEOFENCE = ("geofence_low", "geofence_high")
ARM_DRIVER, CHECKLIST = "arm_driver", "checklist"
# in `nodes`
TUNABLE = (*NODES, BRIDGE, ARM_DRIVER, CHECKLIST, "recorder", "cockpit", FLIGHT_CONTROLLER)


def settings_of(lab: Lab, command: str = "", dry_run: bool = False) -> FlightSettings:
    """Return the checked settings; the room is the supervisor's geofence.

    The scenario must be feasible within the room from a take-off at its origin. The mission waits
    for the command start. Raises what `flight_settings.settings` raises.
    """
    given = {node: values for node, values in lab.nodes.items() if node in SHARED}
    fence = {"geofence_low": list(lab.room.low), "geofence_high": list(lab.room.high)}
    given["mission"] = given.get("mission", {}) | fence
    law = catalogue.DEFAULT
    if lab.profile:
        law = load_profile(*lab.profile, vehicle=lab.vehicle).laws()["position_controller"]
    return flight_settings.settings(
        scenario=lab.scenario,
        profile=list(lab.profile) or None,
        controller=law,
        vehicle=lab.vehicle.source,
        clock="realtime",
        imu=lab.imu,
        autopilot=lab.autopilot,
        gcs=lab.gcs,
        auto_start=False,
        dry_run=dry_run,
        view=True,
        parameters=given,
        process=lab.process,
        command=command,
        fused=lab.fused,
    )


def template() -> str:
    return lab_path(TEMPLATE).read_text(encoding="utf-8")


def lab_path(name_or_file: str | Path) -> Path:
    """Return the file of config/lab, or the file. Raises ConfigurationError."""
    return configuration.named(FOLDER, str(name_or_file), suffixes=(".yaml",))


def load_lab(name_or_file: str | Path) -> Lab:
    """Read and check a lab file. Raises LabError, ConfigurationError; each text is one line."""
    top = read_lab(lab_path(name_or_file))
    for key in REQUIRED:
        if key not in top.values:
            raise top.error(key, f"missing; required are: {', '.join(REQUIRED)}")
    vehicle = lab_vehicle(top)
    chain, arm_file = lab_arm(top, vehicle)
    mocap = lab_mocap(top)
    if mocap is not None:
        _tried(top, "mocap", lambda: calibration.load(mocap.calibration))
    lab = Lab(
        file=_file(top),
        vehicle=vehicle,
        profile=_profile(top),
        scenario=_near(top, top.text("scenario")),
        autopilot=_autopilot(top),
        gcs=_gcs(top),
        autopilot_system=top.whole("autopilot_system", 1, LAST_SYSTEM, default=1),
        imu=top.one_of("imu", IMUS),
        room=_room(top),
        mocap=mocap,
        arm=chain,
        arm_file=arm_file,
        magnet=_magnet(top),
        cockpit=_cockpit(top),
        nodes=_nodes(top),
        out=Path(top.text("out", default=OUT)),
        process=_process(top),
        fused=top.one_of("layout", LAYOUTS, default=SEPARATE) == FUSED,
    )
    _check_profile(top, lab)
    try:
        settings_of(lab)
    except (SettingsError, ConfigurationError, ScenarioError, ProfileError) as error:
        raise LabError(f"{lab.file}: {error}") from None
    return lab


def read_lab(file: Path) -> Section:
    """Return the content of a lab file, without its entries' checks. Raises LabError."""
    top = read_section(file, LabError)
    top.only(REQUIRED + OPTIONAL)
    return top


def lab_vehicle(top: Section) -> VehicleDescription:
    """Return the described vehicle. Raises LabError."""
    named = _near(top, top.text("vehicle"))
    return _tried(top, "vehicle", lambda: load_description(named))


def lab_arm(top: Section, vehicle: VehicleDescription) -> tuple[ArmChain, Path]:
    """Return the servos and the file that describes them. Raises LabError."""
    try:
        file = chain_file(_file(top))
        return load_chain(file, vehicle), file
    except ArmError as error:  # names file and entry
        raise LabError(str(error)) from None


def lab_mocap(top: Section) -> MocapParameters | None:
    """Return the parameters of the motion capture driver, None for another's poses.

    The calibration may be missing: it is checked by `load_lab`. Raises LabError.
    """
    if top.entry("mocap") == TOPIC:
        return None
    values = dict(top.section("mocap").values)
    if isinstance(values.get("calibration"), str):
        values["calibration"] = _near(top, values["calibration"])
    return _tried(top, "mocap", lambda: MocapParameters.from_mapping(values))


def _profile(top: Section) -> tuple[str, ...]:
    given = top.values.get("profile", [])
    given = [given] if isinstance(given, str) else given
    if not isinstance(given, list) or not all(isinstance(one, str) and one for one in given):
        raise top.error("profile", f"a name, a file, or a list of them expected, got {given!r}")
    return tuple(_near(top, one) for one in given)


def _autopilot(top: Section) -> str:
    url = top.text("autopilot")
    if ":" not in url:
        raise top.error("autopilot", f"'{url}' is no link; allowed: {ALLOWED}")
    _tried(top, "autopilot", lambda: parse_url(url))
    return url


def _gcs(top: Section) -> str:
    if "gcs" not in top.values:
        return ""
    url = top.text("gcs")
    if ":" not in url or _tried(top, "gcs", lambda: parse_url(url)).kind != "udp":
        raise top.error("gcs", f"'{url}' is no link to a ground station: udp:HOST:PORT expected")
    return url


def _room(top: Section) -> Room:
    room = top.section("room")
    room.only("xyz")
    corners = [room.numbers(axis, 2) for axis in "xyz"]
    for axis, (low, high) in zip("xyz", corners, strict=True):
        if not low < high:
            raise room.error(axis, f"{low:g} is not below {high:g}: [smallest, largest] expected")
    low, high = zip(*corners, strict=True)
    return Room(low, high)


def _magnet(top: Section) -> Magnet:
    section = top.section("magnet")
    through = section.one_of("through", THROUGH)
    values = {name: value for name, value in section.values.items() if name != "through"}
    sets: dict[str, type[ParameterSet]] = {}
    if through == GPIO:
        sets["line"] = LineParameters
    elif through == AUTOPILOT:
        sets["output"] = AutopilotMagnetParameters
    if through in (GPIO, AUTOPILOT):
        sets["switching"] = SwitchingParameters
    section.only(["through", *(name for kind in sets.values() for name in kind.specs())])
    found = {
        key: _tried(top, "magnet", lambda kind=kind: kind.among(values))
        for key, kind in sets.items()
    }
    magnet = Magnet(through, **found)
    if through == AUTOPILOT and magnet.output.magnet == NONE:
        raise section.error("magnet", "actuator or gripper expected with through: autopilot")
    return magnet


def _cockpit(top: Section) -> Page:
    if "cockpit" not in top.values:
        return Page()
    section = top.section("cockpit")
    section.only(("address", "port"))
    page = Page()
    return Page(
        section.text("address", default=page.address),
        section.whole("port", 0, 65535, default=page.port),
    )


def _nodes(top: Section) -> dict[str, dict[str, Any]]:
    given = top.values.get("nodes") or {}
    if not isinstance(given, dict):
        raise top.error("nodes", f"node: {{name: value}} expected, got {given!r}")
    nodes = Section(given, f"{_file(top)}: nodes", LabError)
    nodes.only(TUNABLE)
    for node in given:
        values = nodes.section(node)
        if node == "mission":
            for name in GEOFENCE:
                if name in values.values:
                    raise values.error(name, "follows from the section room")
        elif node == ARM_DRIVER:
            _tried(nodes, node, lambda v=values: ArmDriverParameters.from_mapping(v.values))
        elif node == CHECKLIST:
            _tried(nodes, node, lambda v=values: check_checklist(v.values))
    return {node: dict(values) for node, values in given.items()}


def _process(top: Section) -> dict[str, Any]:
    if "process" not in top.values:
        return {}
    values = dict(top.section("process").values)
    _tried(top, "process", lambda: ProcessParameters.from_mapping(values))
    return values


def _check_profile(top: Section, lab: Lab) -> None:
    """Refuse a profile that does not fit the vehicle's servos."""
    if not lab.profile:
        return
    profile = _tried(top, "profile", lambda: load_profile(*lab.profile, vehicle=lab.vehicle))
    desired = servo_mode(profile)["servos.mode"]
    mode = lab.vehicle.numbers["servos"]["mode"]
    if desired != mode:
        raise top.error(
            "profile", f"{profile.name} drives the servos by {desired}, the vehicle's are {mode}"
        )


def _file(top: Section) -> Path:
    return Path(top.where.removesuffix(":"))


def _near(top: Section, name: str) -> str:
    """Return the path of the file `name` beside the lab file; without one, `name` as it is."""
    beside = _file(top).parent / Path(name).expanduser()
    return str(beside.absolute()) if beside.is_file() else name


def _tried(section: Section, key: str, make: Callable[[], Any]) -> Any:
    """Return the result of `make`; its refusal becomes a LabError that names the entry."""
    try:
        return make()
    except (
        *(ParameterError, ConfigurationError, VehicleError, ProfileError, PortError, MocapError),
    ) as error:
        raise section.error(key, str(error)) from None
