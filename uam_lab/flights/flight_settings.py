"""Settings of a flight: the options of the command line, checked before anything starts."""

import importlib.util
import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from uam_control.estimation.pose_anchor import MOCAP, ODOMETRY
from uam_control.mission import Feasibility, Scenario, ScenarioOptions, load_scenario
from uam_control.profiles.profile import Profile, complete_profile, default_profile, load_profile
from uam_control.setpoints.setpoint_types import WRENCH
from uam_control.settings import configuration
from uam_control.settings.process_parameters import ProcessParameters
from uam_control.vehicle import POSITION_SERVO, VehicleDescription, chain_of, load_description
from uam_lab.flights import clearance, node_options, plant_fit
from uam_lab.flights.flight_options import (
    AUTOPILOT_IMU,
    BUILTIN,
    COCKPIT,
    ONLOOKERS,
    PX4,
    REPLACEABLE,
    FlightOptions,
    KeptOptions,
)
from uam_lab.flights.node_options import SettingsError
from uam_lab.flights.processes import middleware
from uam_lab.flights.processes.node_environment import without_discovery
from uam_msgs_py.node import process_options
from uam_msgs_py.node.namespace import normal
from uam_sim_bridge.faults import FaultError, Schedule, feasibility, read_schedule
from uam_sim_bridge.faults.actuator_faults import ServoWeak
from uam_sim_bridge.faults.faulty_plant import check_engine
from uam_sim_bridge.faults.imu_faults import of_the_companion
from uam_sim_bridge.faults.process_faults import DiscoveryLoss
from uam_sim_bridge.mavlink.hil.hil_server import open_only_here
from uam_sim_bridge.mavlink.transport.transport import ALLOWED, LinkUrl, parse_url
from uam_sim_bridge.plant.effects import presets
from uam_sim_bridge.plant.effects.pose_effects import OdometryDrift
from uam_sim_bridge.ports import AUTOPILOT_UDP, INSTANCES
from uam_sim_bridge.px4 import px4_parameters
from uam_sim_bridge.px4.px4_installation import Px4Installation

DEVICES = ("serial/by-id/*", "ttyACM*", "ttyUSB*")  # of /dev, on which an autopilot may be
LAYOUTS = {False: "separate nodes", True: "fused: control nodes in one process"}
NODE_NAME = re.compile(r"[A-Za-z_]\w*", re.ASCII)
AUTOPILOT = "autopilot"  # name of its process
PX4_PERIOD = 0.004  # [s] between two answers of PX4 in software, which waits for more samples


@dataclass(frozen=True, kw_only=True)
class FlightSettings(KeptOptions):
    """Checked settings of one flight, with scenario and profile loaded; see `FlightOptions`, too.
    remappings: node, or EVERY_NODE → topic or service → new name."""

    scenario: Scenario
    profile: Profile
    vehicle: VehicleDescription
    payload_mass: float  # [kg]
    out: Path | None = None  # None for the default folder
    px4: Px4Installation | None = None  # for the autopilot PX4
    link: LinkUrl | None = None  # to an autopilot started by the user, parsed
    scenario_source: str = ""  # as given by the user: a name or a file
    scenario_options: ScenarioOptions = ScenarioOptions()
    notes: tuple[str, ...] = ()  # about the settings, for the user
    instance: int | None = None  # of ROS domain and ports; None: the first free one
    vehicle_changes: dict[str, object] = field(default_factory=dict)
    without: tuple[str, ...] = (COCKPIT,)  # nodes that are not started, see `foreign`
    own_names: dict[str, str] = field(default_factory=dict)  # node → other name of the user's
    faults: Schedule = Schedule()
    auto_start: bool = True
    parameters: dict[str, dict[str, Any]] = field(default_factory=dict)  # of nodes without profile
    remappings: dict[str, dict[str, str]] = field(default_factory=dict)
    namespace: str = "/"  # in the form of ROS
    process: ProcessParameters = ProcessParameters()  # of the nodes that fly

    @property
    def layout(self) -> str:
        """Return the layout of the control nodes, for the records of the flight."""
        return LAYOUTS[self.fused]

    @property
    def pose_source(self) -> str:
        """Return where the poses come from, as the nodes' parameter."""
        effects = self.vehicle_changes.get("effects", {})
        return ODOMETRY if OdometryDrift.NAME in effects else MOCAP

    @property
    def foreign(self) -> tuple[str, ...]:
        """Return the nodes that the user starts and for which the flight waits."""
        return tuple(name for name in self.without if name in REPLACEABLE)


TRANSIT = 0.8  # of the largest yaw rate


def settings(scenario: str | Path | None = None, **given: Any) -> FlightSettings:
    """Return the settings of a flight with these options, see `FlightOptions`.

    Scenario, profile and faults are loaded; it is checked that they can be flown together.

    Raises SettingsError, ConfigurationError, ScenarioError (InfeasibleReference too), ProfileError,
    Px4Error, PortError, PlantError, FaultError; each text is one line for the user.
    """
    o = FlightOptions.of(scenario=scenario, **given)
    without, own_names = _left_out(o.without)
    px4 = Px4Installation.find(o.px4_dir) if o.autopilot == PX4 else None
    px4_parameters.parse(o.px4_params, None if px4 is None else px4.ranges())
    link = _link(o)
    if o.gcs and (parse_url(o.gcs).kind != "udp" or o.engine == "direct"):
        raise SettingsError("--gcs must be udp:HOST:PORT and needs --engine ros")
    try:
        namespace = normal(o.namespace)
        process = ProcessParameters.from_mapping(dict(o.process))
        process_options.try_out(process)
    except ValueError as error:  # ParameterError too
        raise SettingsError(str(error)) from None
    vehicle = load_description(str(o.vehicle))
    changes = node_options.checked_changes(o.vehicle_changes, vehicle.numbers)
    profile, own = _profile(o, vehicle, namespace)
    scenario_options = _scenario_options(o, profile.sets["mission"].reference_yaw_rate)
    source = str(configuration.named("scenarios", str(o.scenario)))
    scenario = load_scenario(source, vehicle, scenario_options)
    if profile.whole and (alone := [node for node in without if node in profile.laws()]):
        raise SettingsError(f"without {alone[0]}: {o.controller} is one law of all controllers")
    if o.autopilot == PX4 and profile.setpoint == WRENCH:
        raise SettingsError(
            "--autopilot px4: PX4 v1.16 and v1.17 take no torque over MAVLink: a profile with the "
            "setpoints rates, attitude or position, or --autopilot builtin"
        )
    if o.autopilot == PX4 and vehicle.control_period < PX4_PERIOD:
        raise SettingsError(
            f"--autopilot px4: PX4 in software answers every {1e3 * PX4_PERIOD:g} ms: "
            f"control_period of {vehicle.name} is {1e3 * vehicle.control_period:g} ms"
        )
    mass = scenario.payload_mass if o.payload_mass is None else o.payload_mass
    feasible = Feasibility(vehicle, profile.sets["mission"], mass)
    if o.retime:
        scenario, factor = feasible.retimed(scenario)
        scenario_options = replace(scenario_options, slowdown=factor)
        how = f"{factor:.4g} times as slow" if factor > 1.0 else "as written"
        about = f"retimed: {how}"
    else:
        scenario = feasible.fitted(scenario)
        about = feasible.check(scenario)
    clearance.check_standing(vehicle, scenario, o.plant)
    effects = presets.read(o.plant_preset, o.effects)
    made = FlightSettings(
        **{name: getattr(o, name) for name in KeptOptions.specs()},
        scenario=scenario,
        profile=profile,
        vehicle=vehicle,
        payload_mass=mass,
        out=None if o.out is None else Path(o.out),
        px4=px4,
        link=link,
        scenario_source=str(o.scenario),
        scenario_options=scenario_options,
        notes=scenario.notes
        + profile.misfits
        + node_options.unread(profile)
        + _about_the_arm(vehicle, scenario, mass)
        + ((about,) if about else ())
        + clearance.notes(vehicle, scenario, mass)
        + plant_fit.notes(profile, effects, scenario),
        instance=_instance_of(link) if o.instance is None else o.instance,
        vehicle_changes=presets.added(changes, effects),
        without=tuple(dict.fromkeys(without if o.view else (*without, COCKPIT))),
        own_names=own_names,
        faults=read_schedule(o.faults, scenario, o.seed),
        auto_start=o.auto_start and not o.dry_run and (o.arm or link is None or not link.real),
        parameters=own,
        remappings=node_options.remappings(o.remappings, o.engine),
        namespace=namespace,
        process=process,
    )
    check_feasible(made, made.faults)
    return made


def _scenario_options(o: FlightOptions, yaw_rate: float) -> ScenarioOptions:
    """Return the options of the scenario; yaw_rate [rad/s]: the largest of a reference, of which
    the way to a trajectory has at most TRANSIT."""
    usual = ScenarioOptions(o.end, o.transit_speed, o.transit_acceleration)
    least = ScenarioOptions.specs()["transit_yaw_rate"].low
    slow = max(least, min(usual.transit_yaw_rate, TRANSIT * yaw_rate))
    return replace(usual, transit_yaw_rate=slow)


def _profile(
    o: FlightOptions, vehicle: VehicleDescription, namespace: str
) -> tuple[Profile, dict[str, dict[str, Any]]]:
    """Return the profile of the options' law, and the parameters of nodes without a profile."""
    if not o.profile:
        profile = default_profile(o.controller, vehicle)
    else:
        # a file may have a part of the parameters where there is no name for the others
        own = complete_profile(o.controller, vehicle)
        profile = load_profile(
            *(str(configuration.named("profiles", str(one))) for one in o.profile),
            vehicle=vehicle,
            namespace=namespace,
            onto=None if own else default_profile(o.controller, vehicle).sections,
        )
    parameters = dict(o.parameters)
    if o.inner_rate is not None:
        own = parameters.get(node_options.FLIGHT_CONTROLLER, {})
        parameters[node_options.FLIGHT_CONTROLLER] = {**own, "inner_rate": o.inner_rate}
    profile, others = node_options.parameters(profile, parameters, o.engine, o.fused)
    for node, law in profile.laws().items():
        if law != o.controller:
            raise SettingsError(
                f"profile {profile.name} has the law {law} for {node}, not {o.controller}: "
                f"--controller {law}, or another --profile"
            )
    return profile, others


def _about_the_arm(vehicle: VehicleDescription, scenario: Scenario, mass: float) -> tuple[str, ...]:
    """Return notes about an entry of older files, and about a payload without an end effector."""
    name, found = vehicle.file.name, []
    if "arm" in vehicle.numbers:
        found.append(f"{name}: arm: not used, the lengths are those of {vehicle.model.name}")
    if scenario.magnet and mass and not chain_of(vehicle).has_hand:
        found.append(f"{name} has no end effector: nothing is steered to the payload")
    return tuple(found)


def check_feasible(flight: FlightSettings, faults: Schedule) -> None:
    """Raise FaultError for faults that this flight cannot have."""
    absent = (*flight.without, "autopilot") if flight.link is not None else flight.without
    refused = {DiscoveryLoss.NAME: without_discovery()}
    check_engine(faults, flight.plant, flight.vehicle_changes.get("effects"))
    weak = [one for one in faults.faults if isinstance(one.fault, ServoWeak)]
    if weak and flight.profile.sets["arm_controller"].setpoint == POSITION_SERVO:
        raise FaultError(
            f"{ServoWeak.NAME}: scales torque commands, but profile {flight.profile.name} sends "
            "goal positions (setpoint of arm_controller)"
        )
    unused = [one.fault for one in faults.faults if of_the_companion(one.fault)]
    if unused and flight.imu == AUTOPILOT_IMU:
        raise FaultError(
            f"{unused[0].NAME}: changes the companion's IMU, but the estimator has the autopilot's "
            "(--imu autopilot)"
        )
    feasibility.check(faults, flight.engine, absent, refused, flight.vehicle)


def require_ros() -> None:
    """Raise SettingsError if ROS, or the middleware that it shall use, is not installed."""
    if importlib.util.find_spec("rclpy") is None:
        raise SettingsError(
            "the ROS engine needs rclpy, which is not installed: make setup, or source a ROS 2 "
            "installation, or fly with --engine direct"
        )
    if reason := middleware.refusal():
        raise SettingsError(reason)


def require_device(link: LinkUrl | None) -> None:
    """Raise SettingsError if the serial device of the link is missing."""
    if link is None or link.kind != "serial" or Path(link.place).exists():
        return
    found = sorted(str(one) for name in DEVICES for one in Path("/dev").glob(name))
    raise SettingsError(
        f"autopilot: serial device {link.place} does not exist; there are: "
        f"{', '.join(found) or 'none'}; plug it in, or name another one"
    )


def _left_out(without: Sequence[str]) -> tuple[tuple[str, ...], dict[str, str]]:
    """Return the nodes that are not started, and the names of own nodes that replace them."""
    names, own = [], {}
    for entry in without:
        node, equals, name = entry.partition("=")
        allowed = REPLACEABLE if equals else REPLACEABLE + ONLOOKERS
        if node not in allowed:
            raise SettingsError(
                f"unknown node to fly without '{node}'; there are: {', '.join(allowed)}"
            )
        names.append(node)
        if equals:
            if not NODE_NAME.fullmatch(name):
                raise SettingsError(f"without {entry}: '{name}' is no name of a node")
            own[node] = name
    return tuple(names), own


def _link(o: FlightOptions) -> LinkUrl | None:
    """Return the link to an autopilot of the user, None for those that the flight starts."""
    link = None
    if o.autopilot not in (BUILTIN, PX4):
        if ":" not in o.autopilot:
            raise SettingsError(
                f"unknown autopilot '{o.autopilot}'; there are: {BUILTIN}, {PX4}, or a link: "
                f"{ALLOWED}"
            )
        link = parse_url(o.autopilot)
    serial = link is not None and link.kind == "serial"
    if not open_only_here(o.sim_address) and (link is None or serial):
        raise SettingsError(
            "--sim-address needs an autopilot that you start: --autopilot udp:HOST:PORT or tcp:..."
        )
    if serial and o.clock != "realtime":
        raise SettingsError(
            "a flight controller runs on its own clock: --autopilot serial:... "
            "needs --clock realtime"
        )
    return link


def _instance_of(link: LinkUrl | None) -> int | None:
    """Return the instance whose simulator port the user's autopilot connects to.

    PX4's offboard port determines the instance; any other port means instance 0.
    """
    if link is None or link.kind == "serial":
        return None
    number = link.number - AUTOPILOT_UDP
    return number if link.kind == "udp" and 0 <= number < INSTANCES else 0
