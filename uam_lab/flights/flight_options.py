"""The options of a flight, each described once: library, command line and lab file have these."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

from uam_control.laws import catalogue
from uam_control.mission import ScenarioOptions
from uam_control.mission.scenarios.environment import HEAVIEST
from uam_control.settings.parameter_set import (
    ParameterError,
    ParameterSet,
    choice,
    entries,
    integer,
    number,
    switch,
    text,
    texts,
)
from uam_control.vehicle import DEFAULT_VEHICLE
from uam_lab.flights.node_options import SettingsError
from uam_sim_bridge.mavlink.hil.sitl_ports import HOST
from uam_sim_bridge.mavlink.transport.transport import ALLOWED
from uam_sim_bridge.plant.plant import DEFAULT_PLANT, PLANTS
from uam_sim_bridge.ports import INSTANCES, LAST_DOMAIN

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
ONLOOKERS = ("scene", COCKPIT)  # nodes that only display: their end does not end the flight
LAST_SEED = 2**31 - 1
LOG_LIMIT = 4000.0  # [MB] some four hours of flight


def _of_scenario(name: str) -> Any:
    default = getattr(ScenarioOptions(), name)
    return field(default=default, metadata={"spec": ScenarioOptions.specs()[name]})


@dataclass(frozen=True)
class KeptOptions(ParameterSet):
    """Options that the settings of a flight have as they are given."""

    controller: str = choice(catalogue.DEFAULT, "law of the controllers", catalogue.LAWS)
    engine: str = choice("ros", "nodes and sockets, or one loop without them", ENGINES)
    clock: str = choice(
        "lockstep", "simulated time, repeatable for the same seed; or the wall clock", CLOCKS
    )
    imu: str = choice(
        IMUS[0], "IMU of the estimator: the companion's, or the autopilot's over MAVLink", IMUS
    )
    plant: str = text(
        DEFAULT_PLANT,
        f"physics engine: {', '.join(PLANTS)}, or a class of your own",
        "NAME|MODULE:CLASS",
    )
    autopilot: str = text(
        BUILTIN,
        "the stand-in; PX4 in software; or the link of an autopilot that you started: "
        f"{ALLOWED}; serial: a flight controller in HITL mode",
        "builtin|px4|URL",
    )
    px4_params: tuple[str, ...] = texts(
        "a parameter of PX4 in software, in place of config/'s; with --autopilot px4", "NAME=VALUE"
    )
    sim_address: str = text(
        HOST,
        "address of this machine at which the simulator waits for an autopilot that you start; "
        "0.0.0.0: also from other machines, which is not secure",
        "ADDRESS",
    )
    gcs: str = text("", "ground station, as udp:127.0.0.1:14550 (default: none)", "URL")
    seed: int = integer(1, "of all noise", 0, LAST_SEED)
    log_limit: float = number(
        LOG_LIMIT, "size at which log.mcap ends, after hours; the flight continues", "MB", 1.0, 1e9
    )
    dry_run: bool = switch(
        False, "compute all commands for the present pose; send none, arm nothing"
    )
    command: str = text("", "for the record of the flight", "COMMAND")
    domain: int | None = integer(
        None, f"ROS domain, 0..{LAST_DOMAIN} (default: that of the instance)", 0, LAST_DOMAIN
    )
    tick_times: bool = switch(False, "measure the ticks of the nodes that fly")
    fused: bool = switch(
        False,
        "estimator, mission, controllers and bridge as one process, for few cores: "
        "docs/architecture.md",
    )


@dataclass(frozen=True)
class FlightOptions(KeptOptions):
    """Options as they are given; None stands for the default.

    profile: a later one overrides, see `load_profile`; plant_preset, effects: see
    `effects.presets.read`; vehicle_changes: dotted entries of config/vehicle/*.yaml to replace;
    faults: see `faults.read_schedule`. parameters: node → name → value, in place of the profile's;
    remappings: topic or service → new name for every node, or node → such a mapping; process:
    parameters of `ProcessParameters`. auto_start False: wait for the command start. tick_times: the
    nodes write the times of their ticks to logs/. command: how the flight was requested.
    """

    scenario: str | Path = text("pick_and_place", "what is flown", "NAME|FILE", file=True)
    end: str = _of_scenario("end")
    retime: bool = switch(
        False, "slow a scenario that exceeds a limit of the vehicle down until it does not"
    )
    transit_speed: float = _of_scenario("transit_speed")
    transit_acceleration: float = _of_scenario("transit_acceleration")
    profile: tuple[str | Path, ...] = texts("parameters of the nodes", "NAME|FILE", file=True)
    vehicle: str | Path = text(DEFAULT_VEHICLE, "vehicle", "NAME|FILE", file=True)
    plant_preset: tuple[str, ...] = texts("effects of the plant", "NAME|FILE")
    effects: tuple[str, ...] = texts("changes of these effects", "SPEC")
    px4_dir: str | Path | None = text(
        None,
        "PX4's build directory, with bin/px4 and etc/ (default: $PX4_SITL_DIR)",
        "DIR",
        file=True,
    )
    payload_mass: float | None = number(None, "default: the scenario's", "kg", 0.0, HEAVIEST)
    out: str | Path | None = text(None, "result folder", "DIR", file=True)
    vehicle_changes: Mapping[str, Any] = entries("changes of the vehicle's numbers")
    instance: int | None = integer(
        None,
        f"ROS domain and ports of this instance, 0..{INSTANCES - 1}, numbered as PX4 does "
        "(default: the first free one)",
        0,
        INSTANCES - 1,
    )
    without: tuple[str, ...] = texts(
        "do not start this node, wait for yours of that name, or of NAME: "
        f"{', '.join(REPLACEABLE)}; or do not start a display: {', '.join(ONLOOKERS)}",
        "NODE[=NAME]",
    )
    view: bool = switch(
        False, "serve the cockpit, a local web page: the scene, charts, gains, commands"
    )
    faults: tuple[str, ...] = texts(
        "inject a fault: NAME@SECONDS[+DURATION] or NAME@PHASE[+AFTER[+DURATION]], then "
        ":parameter=value,...; or a YAML file with several faults; uam faults --list shows all",
        "SPEC|FILE",
    )
    arm: bool = switch(
        False, "arm and take off by itself also with a real autopilot (serial, another host)"
    )
    auto_start: bool = switch(True, "begin without a command")
    parameters: Mapping[str, Any] = entries("parameters of single nodes")
    remappings: Mapping[str, Any] = entries("other names of topics and services")
    namespace: str = text(
        "",
        "namespace of all nodes, for several vehicles in one ROS domain (default: none)",
        "NAME",
    )
    process: Mapping[str, Any] = entries("of the processes of the nodes that fly")
    inner_rate: float | None = number(
        None,
        "with --fused: messages per second sent of the topics within it (default: all)",
        "Hz",
        0.0,
        1000.0,
    )

    @classmethod
    def of(cls, **given: Any) -> Self:
        """Return checked options. Raises SettingsError, one line."""
        try:
            return cls.from_mapping({k: v for k, v in given.items() if v is not None})
        except ParameterError as error:
            raise SettingsError(str(error)) from None

    def check_together(self) -> None:
        """Raise SettingsError for options that contradict each other."""
        for asks, why in NOT_DIRECT if self.engine == "direct" else ():
            if asks(self):
                raise SettingsError(f"the direct engine has {why.format(self)} --engine ros")
        for contradicts, why in CONTRADICTIONS:
            if contradicts(self):
                raise SettingsError(why.format(self))


# what the direct engine has not: whether it is asked for → what it has, and which option asks
NOT_DIRECT: tuple[tuple[Callable[[FlightOptions], Any], str], ...] = (
    (lambda o: o.clock == "realtime", "no clock: --clock realtime needs"),
    (
        lambda o: o.autopilot != BUILTIN,
        "only the built-in autopilot: --autopilot {0.autopilot} needs",
    ),
    (lambda o: o.without, "no nodes: --without needs"),
    (lambda o: o.view, "no topics to show: --view needs"),
    (
        lambda o: o.namespace.strip("/") or o.domain is not None,
        "no nodes: --namespace and --domain need",
    ),
    (lambda o: o.process or o.tick_times, "no nodes: options of their processes need"),
    (lambda o: o.fused, "no nodes: --fused needs"),
    (lambda o: not o.auto_start, "no command to start: auto_start=False needs"),
)
CONTRADICTIONS: tuple[tuple[Callable[[FlightOptions], Any], str], ...] = (
    (
        lambda o: o.imu == AUTOPILOT_IMU and o.autopilot != BUILTIN and o.clock != "realtime",
        "only the stand-in sends its IMU in step with the plant: --imu autopilot with another "
        "--autopilot needs --clock realtime",
    ),
    (
        lambda o: o.engine == "direct" and o.dry_run,
        "a dry run needs --engine ros: the direct engine is a simulation",
    ),
    (
        lambda o: o.px4_params and o.autopilot != PX4,
        "--px4-param needs --autopilot px4: this command writes no parameter of an autopilot "
        "that you started",
    ),
    (
        lambda o: o.autopilot == PX4 and o.parameters.get("mavlink_bridge", {}).get("signing_key"),
        "signing_key of mavlink_bridge: PX4 v1.16 and v1.17 have no MAVLink signing, v1.18 in "
        "software has no key: the bridge would refuse all messages; leave it out",
    ),
    (
        lambda o: o.inner_rate is not None and not o.fused,
        "--inner-rate needs --fused: separate nodes need every message",
    ),
    (
        lambda o: (
            o.inner_rate is not None and any(one.startswith(REPLACEABLE) for one in o.without)
        ),
        "--inner-rate needs every control node in the process: with --without the nodes need every "
        "message",
    ),
)


def check_clock(engine: str, clock: str) -> None:
    """Raise SettingsError for a clock that the engine does not have."""
    FlightOptions.of(engine=engine if engine in ENGINES else ENGINES[0], clock=clock)
