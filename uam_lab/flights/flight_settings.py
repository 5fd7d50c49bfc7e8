"""Settings of a flight: the options of the command line, checked before anything starts."""

from __future__ import annotations

import importlib.util
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from uam_control.laws import catalogue
from uam_control.mission import Feasibility, Scenario, ScenarioOptions, load_scenario
from uam_control.profiles.profile import (
    Profile,
    default_profile,
    load_profile,
    own_profile,
)
from uam_control.profiles.profile_fit import misfits
from uam_control.settings import configuration
from uam_control.settings.parameter_set import ParameterError
from uam_control.settings.process_parameters import ProcessParameters
from uam_control.vehicle import (
    DEFAULT_VEHICLE,
    POSITION_SERVO,
    VehicleDescription,
    load_description,
)
from uam_lab.flights import arm_on_ground, node_options, option_types
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
from uam_sim_bridge.mavlink.hil.sitl_ports import HOST
from uam_sim_bridge.mavlink.transport.transport import ALLOWED, LinkUrl, parse_url
from uam_sim_bridge.plant.effects import presets
from uam_sim_bridge.plant.engines import DEFAULT_PLANT
from uam_sim_bridge.plant.vehicle import PAYLOAD_MAX
from uam_sim_bridge.ports import AUTOPILOT_UDP, INSTANCES, LAST_DOMAIN
from uam_sim_bridge.px4 import px4_parameters
from uam_sim_bridge.px4.px4_installation import Px4Installation

ENGINES = ("ros", "direct")
CLOCKS = ("lockstep", "realtime")
BUILTIN, PX4 = "builtin", "px4"
AUTOPILOT_IMU = "autopilot"
IMUS = ("topic", AUTOPILOT_IMU)
# Nodes that the user may replace by own nodes with the same topics.
REPLACEABLE = (
    "state_estimator",
    "mission",
    "position_controller",
    "attitude_controller",
    "arm_controller",
)
COCKPIT = "cockpit"
DEVICES = ("serial/by-id/*", "ttyACM*", "ttyUSB*")  # of /dev, on which an autopilot may be
LAYOUTS = {False: "separate nodes", True: "fused: control nodes in one process"}
LAST_SEED = 2**31 - 1
NODE_NAME = re.compile(r"[A-Za-z_]\w*", re.ASCII)
LOG_LIMIT = 4000.0  # [MB] some four hours of flight
AUTOPILOT = "autopilot"  # name of its process
ONLOOKERS = ("scene", COCKPIT)  # nodes that only display: their end does not end the flight


@dataclass(frozen=True)
class FlightSettings:
    """Checked settings of one flight, with scenario and profile loaded.

    payload_mass [kg]; vehicle_changes: dotted entries of config/vehicle/*.yaml to replace, as
    {"air.wind": [3.0, 0.0, 0.0]}; imu: the estimator's, of the companion or the autopilot's over
    MAVLink; out: the result folder, None for the default. autopilot: BUILTIN, PX4, or the URL of an
    autopilot started by the user; link: that URL, parsed. without: nodes that are not started, see
    `foreign`; own_names: those of the nodes that the user starts in place of them, where they
    differ. auto_start: the flight begins without a command; dry_run: nothing is armed. parameters:
    of the nodes without a profile, node → name → value.
    remappings: node, or EVERY_NODE → topic or service → new name. command: how the flight was
    requested, for its record. namespace: of all nodes, in the form of ROS; domain: ROS domain,
    None for that of the instance. fused: the control nodes are one process.
    """

    scenario: Scenario
    profile: Profile
    vehicle: VehicleDescription
    payload_mass: float
    out: Path | None = None
    controller: str = catalogue.DEFAULT
    engine: str = "ros"
    clock: str = "lockstep"
    imu: str = IMUS[0]
    autopilot: str = BUILTIN
    px4: Px4Installation | None = None  # for the autopilot PX4
    px4_params: tuple[str, ...] = ()  # NAME=VALUE, for the autopilot PX4
    sim_address: str = HOST  # at which the autopilot connects
    link: LinkUrl | None = None
    gcs: str = ""  # URL of a ground station
    seed: int = 1
    plant: str = DEFAULT_PLANT  # see `plant_class`
    scenario_source: str = ""  # as given by the user: a name or a file
    scenario_options: ScenarioOptions = ScenarioOptions()
    notes: tuple[str, ...] = ()  # about the settings, for the user
    instance: int | None = None  # of ROS domain and ports; None: the first free one
    vehicle_changes: dict[str, object] = field(default_factory=dict)
    without: tuple[str, ...] = (COCKPIT,)
    own_names: dict[str, str] = field(default_factory=dict)
    log_limit: float = LOG_LIMIT  # [MB] size at which log.mcap ends
    faults: Schedule = Schedule()
    auto_start: bool = True
    dry_run: bool = False
    parameters: dict[str, dict[str, Any]] = field(default_factory=dict)
    remappings: dict[str, dict[str, str]] = field(default_factory=dict)
    command: str = ""
    namespace: str = "/"
    domain: int | None = None
    process: ProcessParameters = ProcessParameters()  # of the nodes that fly
    tick_times: bool = False  # whether they measure their ticks
    fused: bool = False

    @property
    def layout(self) -> str:
        """Return the layout of the control nodes, for the records of the flight."""
        return LAYOUTS[self.fused]

    @property
    def foreign(self) -> tuple[str, ...]:
        """Return the nodes that the user starts and for which the flight waits."""
        return tuple(name for name in self.without if name in REPLACEABLE)


def settings(
    scenario: str | Path = "pick_and_place",
    end: str | None = None,
    retime: bool = False,
    transit_speed: float | None = None,
    transit_acceleration: float | None = None,
    controller: str = catalogue.DEFAULT,
    profile: str | Path | Sequence[str | Path] | None = None,
    vehicle: str = DEFAULT_VEHICLE,
    engine: str = "ros",
    clock: str = "lockstep",
    imu: str = IMUS[0],
    plant: str = DEFAULT_PLANT,
    plant_preset: str | Sequence[str] = (),
    effects: str | Sequence[str] = (),
    autopilot: str = BUILTIN,
    px4_dir: str | None = None,
    px4_params: str | Sequence[str] = (),
    sim_address: str = HOST,
    gcs: str = "",
    payload_mass: float | None = None,
    seed: int = 1,
    out: str | Path | None = None,
    vehicle_changes: dict[str, object] | None = None,
    instance: int | None = None,
    without: str | Sequence[str] = (),
    view: bool = False,
    log_limit: float = LOG_LIMIT,
    faults: str | Sequence[str] = (),
    arm: bool = False,
    dry_run: bool = False,
    auto_start: bool = True,
    parameters: Mapping[str, Mapping[str, Any]] | None = None,
    remappings: Mapping[str, str | Mapping[str, str]] | None = None,
    command: str = "",
    namespace: str = "",
    domain: int | None = None,
    process: Mapping[str, Any] | None = None,
    tick_times: bool = False,
    fused: bool = False,
    inner_rate: float | None = None,
) -> FlightSettings:
    """Check the options and load scenario, profile and faults.

    Where a list of texts is expected, one text is a list of one.

    end, transit_speed [m/s], transit_acceleration [m/s^2]: see `ScenarioOptions`; retime: slow the
    scenario down until it is feasible. profile: see `load_profile` for several profiles;
    plant_preset: names or files of effects of the plant, effects: changes to them, see
    `effects.presets.read`; faults: see `faults.read_schedule`; view: serve the cockpit; without:
    nodes, or node=name for an own node of another name; arm: begin by itself also with a real
    autopilot; auto_start False: wait for the command start. parameters: node → name → value, each
    replaces the profile's. remappings: topic or service → new name for every node, or node → such a
    mapping. process: parameters of `ProcessParameters` for the nodes that fly; tick_times: they
    write the times of their ticks to logs/; fused: the control nodes in one process; inner_rate
    [Hz]: of the topics that only they need, see its node. Raises SettingsError,
    ConfigurationError, ScenarioError
    (InfeasibleReference too), ProfileError, Px4Error, PortError, PlantError, FaultError; each text
    is one line for the user.
    """
    given = [profile] if isinstance(profile, str | Path) else [] if profile is None else profile
    if not isinstance(given, Sequence):
        raise SettingsError(f"profile: a name, a path or a list of them expected, got {profile!r}")
    for name, paths in (
        ("scenario", [scenario]),
        ("vehicle", [vehicle]),
        ("profile", given),
        ("out", [] if out is None else [out]),
    ):
        for one in paths:
            option_types.path(name, one)
    seed = option_types.whole("seed", seed)
    for name, value in (("instance", instance), ("domain", domain)):
        if value is not None:
            option_types.whole(name, value)
    for name, value in (
        ("payload_mass", payload_mass),
        ("log_limit", log_limit),
        ("inner_rate", inner_rate),
    ):
        if value is not None:
            option_types.number(name, value)
    without, faults = option_types.texts("without", without), option_types.texts("faults", faults)
    effects = option_types.texts("effects", effects)
    plant_preset = option_types.texts("plant_preset", plant_preset)
    px4_params = option_types.texts("px4_params", px4_params)
    _choice("controller", controller, catalogue.LAWS)
    _choice("engine", engine, ENGINES)
    _choice("clock", clock, CLOCKS)
    _choice("imu", imu, IMUS)
    check_clock(engine, clock)
    if imu == AUTOPILOT_IMU and autopilot != BUILTIN and clock != "realtime":
        raise SettingsError(
            "only the stand-in sends its IMU in step with the plant: --imu autopilot with another "
            "--autopilot needs --clock realtime"
        )
    if engine == "direct" and autopilot != BUILTIN:
        raise SettingsError(
            "the direct engine has only the built-in autopilot: "
            f"--autopilot {autopilot} needs --engine ros"
        )
    without, own_names = _left_out(without)
    if dry_run and engine == "direct":
        raise SettingsError("a dry run needs --engine ros: the direct engine is a simulation")
    if without and engine == "direct":
        raise SettingsError("the direct engine has no nodes: --without needs --engine ros")
    if view and engine == "direct":
        raise SettingsError("the direct engine has no topics to show: --view needs --engine ros")
    px4 = Px4Installation.find(px4_dir) if autopilot == PX4 else None
    if px4_params and px4 is None:
        raise SettingsError(
            "--px4-param needs --autopilot px4: this command writes no parameter of an autopilot "
            "that you started"
        )
    if px4 is not None and (parameters or {}).get("mavlink_bridge", {}).get("signing_key"):
        raise SettingsError(
            "signing_key of mavlink_bridge: PX4 v1.16 and v1.17 have no MAVLink signing, v1.18 in "
            "software has no key: the bridge would refuse all messages; leave it out"
        )
    px4_parameters.parse(px4_params, None if px4 is None else px4.ranges())
    link = None if autopilot in (BUILTIN, PX4) else _link(autopilot)
    if not open_only_here(sim_address) and (link is None or link.kind == "serial"):
        raise SettingsError(
            "--sim-address needs an autopilot that you start: --autopilot udp:HOST:PORT or tcp:..."
        )
    if link is not None and link.kind == "serial" and clock != "realtime":
        raise SettingsError(
            "a flight controller runs on its own clock: --autopilot serial:... "
            "needs --clock realtime"
        )
    try:
        namespace = normal(namespace)
    except ValueError as error:
        raise SettingsError(str(error)) from None
    if domain is not None and not 0 <= domain <= LAST_DOMAIN:
        raise SettingsError(f"domain {domain} is not in 0..{LAST_DOMAIN}")
    if engine == "direct" and (namespace != "/" or domain is not None):
        raise SettingsError(
            "the direct engine has no nodes: --namespace and --domain need --engine ros"
        )
    processing = _process(process or {}, engine, tick_times)
    if engine == "direct" and fused:
        raise SettingsError("the direct engine has no nodes: --fused needs --engine ros")
    if inner_rate is not None:
        if not fused:
            raise SettingsError("--inner-rate needs --fused: separate nodes need every message")
        own = dict(parameters or {}).get(node_options.FLIGHT_CONTROLLER, {})
        own = {node_options.FLIGHT_CONTROLLER: {**own, "inner_rate": inner_rate}}
        parameters = {**(parameters or {}), **own}
    if gcs and (parse_url(gcs).kind != "udp" or engine == "direct"):
        raise SettingsError("--gcs must be udp:HOST:PORT and needs --engine ros")
    if not 0 <= seed <= LAST_SEED:
        raise SettingsError(f"seed {seed} is outside 0..{LAST_SEED}")
    described = load_description(str(vehicle))
    changes = option_types.vehicle_changes(vehicle_changes or {}, described.numbers)
    options = _scenario_options(
        end=end, transit_speed=transit_speed, transit_acceleration=transit_acceleration
    )
    source = str(configuration.named("scenarios", str(scenario)))
    loaded = load_scenario(source, described, options)
    flown = (
        load_profile(
            *(str(configuration.named("profiles", str(one))) for one in given),
            vehicle=described,
            namespace=namespace,
            # a file may then have a part of the parameters: there is no name for the others
            onto=None
            if own_profile(controller, described)
            else default_profile(controller, described).sections,
        )
        if given
        else default_profile(controller, described)
    )
    flown, own = node_options.parameters(flown, parameters or {}, engine, fused)
    for node, law in flown.laws().items():
        if law != controller:
            raise SettingsError(
                f"profile {flown.name} has the law {law} for {node}, not {controller}: "
                f"--controller {law}, or another --profile"
            )
    mass = loaded.payload_mass if payload_mass is None else payload_mass
    if not 0.0 <= mass <= PAYLOAD_MAX:
        raise SettingsError(f"payload mass {mass:g} kg is outside 0..{PAYLOAD_MAX:g} kg")
    feasible = Feasibility(described, flown.sets["mission"], mass)
    slower: tuple[str, ...] = ()
    if retime:
        loaded, factor = feasible.retimed(loaded)
        options = replace(options, slowdown=factor)
        slower = (
            f"retimed: {factor:.4g} times as slow" if factor > 1.0 else "retimed: as written",
        )
    else:
        loaded = feasible.fitted(loaded)
        feasible.check(loaded)
    arm_on_ground.check(described, loaded, plant)
    injected = read_schedule(faults, loaded, seed)
    acting = presets.read(plant_preset, effects)
    left_out = tuple(dict.fromkeys(without if view else (*without, COCKPIT)))
    made = FlightSettings(
        scenario=loaded,
        profile=flown,
        vehicle=described,
        payload_mass=mass,
        out=None if out is None else Path(out),
        controller=controller,
        engine=engine,
        clock=clock,
        imu=imu,
        autopilot=autopilot,
        px4=px4,
        px4_params=px4_params,
        sim_address=sim_address,
        link=link,
        gcs=gcs,
        seed=seed,
        plant=plant,
        scenario_source=str(scenario),
        scenario_options=options,
        notes=loaded.notes
        + slower
        + misfits(flown)
        + node_options.unread(flown)
        + _unsteered(described, loaded, mass),
        instance=_instance_of(link) if instance is None else instance,
        vehicle_changes=presets.added(changes, acting),
        without=left_out,
        own_names=own_names,
        faults=injected,
        log_limit=log_limit,
        auto_start=auto_start and not dry_run and (arm or link is None or not link.real),
        dry_run=dry_run,
        parameters=own,
        remappings=node_options.remappings(remappings or {}, engine),
        command=command,
        namespace=namespace,
        domain=domain,
        process=processing,
        tick_times=tick_times,
        fused=fused,
    )
    check_feasible(made, injected)
    return made


def _unsteered(vehicle: VehicleDescription, scenario: Scenario, mass: float) -> tuple[str, ...]:
    """Return a note if the flight picks a payload with an arm of unknown lengths."""
    if vehicle.arm is not None or not scenario.magnet or not mass:
        return ()
    return (f"{vehicle.file.name} has no section arm: the magnet is not steered to the payload",)


def _scenario_options(**given: Any) -> ScenarioOptions:
    """Return the options that are given; raise SettingsError for an invalid one."""
    try:
        known = {name: value for name, value in given.items() if value is not None}
        return ScenarioOptions.from_mapping(known)
    except ParameterError as error:
        raise SettingsError(str(error)) from None


def _process(given: Mapping[str, Any], engine: str, tick_times: bool) -> ProcessParameters:
    """Return the options of the processes, which this system permits. Raises SettingsError."""
    if (given or tick_times) and engine == "direct":
        raise SettingsError(
            "the direct engine has no nodes: options of their processes need --engine ros"
        )
    try:
        options = ProcessParameters.from_mapping(dict(given))
        process_options.try_out(options)
    except ParameterError as error:
        raise SettingsError(str(error)) from None
    return options


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


def check_clock(engine: str, clock: str) -> None:
    """Raise SettingsError for a clock that the engine does not have."""
    if engine == "direct" and clock == "realtime":
        raise SettingsError("the direct engine has no clock: --clock realtime needs --engine ros")


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
        _choice("node to fly without", node, REPLACEABLE if equals else REPLACEABLE + ONLOOKERS)
        names.append(node)
        if equals:
            if not NODE_NAME.fullmatch(name):
                raise SettingsError(f"without {entry}: '{name}' is no name of a node")
            own[node] = name
    return tuple(names), own


def _link(autopilot: str) -> LinkUrl:
    if ":" not in autopilot:
        raise SettingsError(
            f"unknown autopilot '{autopilot}'; there are: {BUILTIN}, {PX4}, or a link: {ALLOWED}"
        )
    return parse_url(autopilot)


def _instance_of(link: LinkUrl | None) -> int | None:
    """Return the instance whose simulator port the user's autopilot connects to.

    PX4's offboard port determines the instance; any other port means instance 0.
    """
    if link is None or link.kind == "serial":
        return None
    number = link.number - AUTOPILOT_UDP
    return number if link.kind == "udp" and 0 <= number < INSTANCES else 0


def _choice(name: str, value: str, allowed: Collection[str]) -> None:
    if not isinstance(value, str) or value not in allowed:
        raise SettingsError(f"unknown {name} '{value}'; there are: {', '.join(allowed)}")
