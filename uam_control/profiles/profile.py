"""Profiles: ROS parameter files with the parameters of every node of a flight.

    position_controller:
      ros__parameters:
        inertia: [2.2, 2.2, 2.2]
        ...

A profile is read and checked as a whole; the nodes and the direct engine use the same sets. The
output of `ros2 param dump` for the nodes of a flight is a profile, too.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, make_dataclass, replace
from difflib import get_close_matches
from functools import cache
from pathlib import Path
from typing import Any, Self

import numpy as np

from uam_control.control.output_limits import ArmLimits, AttitudeLimits, PositionLimits, RateLimits
from uam_control.coordinates import ARM, ATTITUDE, POSITION, ROLL, YAW
from uam_control.estimation import catalogue as estimators
from uam_control.laws import catalogue
from uam_control.laws.law_parameters import LawParameters
from uam_control.mission import MissionParameters, ScenarioOptions, StartParameters
from uam_control.settings import configuration
from uam_control.settings.parameter_file import EVERY_NODE, ProfileError, read_sections
from uam_control.settings.parameter_set import MissingParameter, ParameterError, ParameterSet
from uam_control.settings.process_parameters import ProcessParameters, TickTimesParameters
from uam_control.settings.texts import unknown
from uam_control.vehicle import VehicleDescription, derived_parameters, load_description

# controller → (parameters of its limits, its part of chi)
CONTROLLERS: dict[str, tuple[type[ParameterSet], slice]] = {
    "position_controller": (PositionLimits, POSITION),
    "attitude_controller": (AttitudeLimits, ATTITUDE),
    "arm_controller": (ArmLimits, ARM),
}
ESTIMATOR, MISSION = "state_estimator", "mission"
NODES = (*CONTROLLERS, ESTIMATOR, MISSION)
BRIDGE = "mavlink_bridge"
READ = (*NODES, BRIDGE)  # nodes of a profile; a file may have sections of others
TOLERATED = 0.3  # relative error of an inertia that the adaptive laws take (docs/your_vehicle.md)
LIKE = 0.85  # likeness of a name that means one of them
# shares that a reference may need: of the bridge's largest body rates; of the acceleration that the
# attitude law's largest torque gives
FOLLOWED, TURNED = 0.9, 0.75
# rates of the hand that count as rest, [s] after the last message of a jog
RESTING, RESTS_AFTER = {"jog_speed": 0.005, "jog_turn_rate": math.radians(1.0)}, 0.3
STOPS = 3.0  # times the time constant of the attitude: a stop that it follows
# what helps against a missing parameter
WHOLE_FIRST = (
    "a file with a part of the parameters needs a whole profile before it, as --profile s500 "
    "--profile {}"
)
NEEDS_PROFILE = (
    "name a file with it as `profile` of the law's class, or give it a default, or the "
    f"description, unit and range that it has in the law {catalogue.DEFAULT}"
)
# of the process of every node
PROCESS = (*ProcessParameters.specs(), *TickTimesParameters.specs())
BRIDGE_LINKS = (
    *("clock", "local_port", "autopilot_port", "autopilot_host", "autopilot_system"),
    *("autopilot", "gcs", "vehicle", "dry_run", "network_delay", "publishers"),
    *("imu_source", "imu_clock", "pose_source"),
    *PROCESS,
)
# Parameters of a node that are not in a profile: they belong to one flight.
FLIGHT_OWN = {
    **dict.fromkeys(CONTROLLERS, ("control_period", "vehicle", "publishers", *PROCESS)),
    ESTIMATOR: ("vehicle", "odometry_rate", "pose_source", "publishers", *PROCESS),
    MISSION: (
        *("control_period", "scenario", "vehicle", "pose_source", "publishers", "state_timeout"),
        *(*PROCESS, *StartParameters.specs()),
        *ScenarioOptions.specs(),
    ),
}


@dataclass(frozen=True)
class Profile:
    """The parameter sets of a flight, by node, and their source: name, file, raw sections."""

    name: str
    file: Path
    vehicle: VehicleDescription  # whose derived values and number of joints the sets have
    sets: dict[str, ParameterSet]
    sections: dict[str, dict[str, Any]]

    def section(self, node: str) -> dict[str, Any]:
        """Return the raw parameters of a node; {} if the profile has none."""
        return self.sections.get(node, {})

    @property
    def setpoint(self) -> str:
        """Return the type of the setpoints, a name of `setpoint_types.SETPOINTS`."""
        return self.section(BRIDGE).get("setpoint", "rates")

    def bridge(self) -> dict[str, Any]:
        """Return the raw parameters of the bridge, without links: every flight has its own."""
        values = self.section(BRIDGE)
        key_is_hidden = values.get("signing_key") == "set"
        aside = (*BRIDGE_LINKS, "signing_key") if key_is_hidden else BRIDGE_LINKS
        return {name: value for name, value in values.items() if name not in aside}

    def laws(self) -> dict[str, str]:
        """Return controller → law."""
        return {node: self.sets[node].law for node in CONTROLLERS}

    @property
    def whole(self) -> bool:
        """Whether the controllers have a law of the whole body."""
        return all(catalogue.law(law).whole for law in self.laws().values())

    @property
    def misfits(self) -> tuple[str, ...]:
        """Lines about numbers that are probably of another vehicle; none if they fit: the position
        controller's inertia and thrust, and the estimator's bandwidths beside the rate of the
        vehicle's motion capture."""
        vehicle, parameters = self.vehicle, self.sets["position_controller"]
        found = []
        for axis, inertia in zip("xyz", getattr(parameters, "inertia", ()), strict=False):
            if abs(inertia - vehicle.mass) > TOLERATED * vehicle.mass:
                found.append(
                    f"inertia {inertia:g} kg along {axis}, the vehicle has {vehicle.mass:g} kg"
                )
                break
        if parameters.thrust_max > vehicle.full_thrust:
            full = f"the rotors' full thrust is {vehicle.full_thrust:.3g} N"
            found.append(f"thrust_max {parameters.thrust_max:g} N, {full}")
        interval = 1.0 / vehicle.numbers["sensors"]["mocap"]["rate"]
        wide = self.sets["state_estimator"].capped(interval)
        text = f"profile {self.name} does not fit {vehicle.name}"
        return tuple(
            f"{text}: {node} {'; '.join(lines)}"
            for node, lines in (("position_controller has", found), ("state_estimator:", wide))
            if lines
        )

    def changed(self, name: str, changes: Mapping[str, Mapping[str, Any]]) -> Self:
        """Return it as `name` with other parameters, node → name → value; raises ProfileError."""
        own = {node: self.section(node) | values for node, values in changes.items()}
        return profile_of(self.sections | own, Path(f"{name}.yaml"), self.vehicle)


def servo_mode(profile: Profile) -> dict[str, str]:
    """Return the change of the vehicle's numbers that the arm controller's setpoints require."""
    return {"servos.mode": profile.sets["arm_controller"].setpoint}


@cache
def controller_parameters(
    law: type[LawParameters], limits: type[ParameterSet]
) -> type[LawParameters]:
    """Return the class with the parameters of `law` and `limits`; one class for each pair."""

    def reduce(self: LawParameters) -> tuple[Any, ...]:
        return _restored, (law, limits, vars(self))

    # pickle finds a class by its name in a module; this class has none there
    name = f"{law.__name__}And{limits.__name__}"
    return make_dataclass(
        name, [], bases=(law, limits), namespace={"__reduce__": reduce}, frozen=True
    )


def _restored(
    law: type[LawParameters], limits: type[ParameterSet], values: dict[str, Any]
) -> LawParameters:
    return controller_parameters(law, limits)(**values)


def parameter_set(
    node: str, values: Mapping[str, Any], vehicle: VehicleDescription | None = None
) -> tuple[type[ParameterSet], tuple[str, ...]]:
    """Return the class of a node's parameters and the names of its axes.

    `law` and `estimator` in values, the node's section, select the class of a controller and of the
    estimator. The axes of the mission are the joints. vehicle: None for the default one. Raises
    ParameterError for an unknown name.
    """
    vehicle = vehicle or load_description()
    if node == ESTIMATOR:
        return estimators.chosen(values).kind, vehicle.coordinates[ARM]
    if node == MISSION:
        return MissionParameters, vehicle.coordinates[ARM]
    limits, part = CONTROLLERS[node]
    law = catalogue.law(values.get("law", catalogue.DEFAULT))
    return controller_parameters(law.kind, limits), vehicle.coordinates[part]


def load_profile(
    *names_or_files: str,
    vehicle: VehicleDescription | None = None,
    namespace: str = "/",
    onto: Mapping[str, Mapping[str, Any]] | None = None,
) -> Profile:
    """Return a profile by name (config/profiles) or from a .yaml file; raises ProfileError.

    With several profiles, a later one replaces single parameters of the earlier ones. Parameters
    that no profile has come from the vehicle (None: the default one), where they follow from it.
    namespace: of the vehicle's nodes, see `read_sections`. onto: sections that come first.
    """
    sections = {node: dict(values) for node, values in (onto or {}).items()}
    files = [_file(given) for given in names_or_files]
    for file in files:
        found = read_sections(file, namespace)
        for node, values in _shared(file, found, sections, vehicle):
            sections[node] = sections.get(node, {}) | values
        for node, values in found.items():
            if _misspelt(node):
                raise ProfileError(f"{file}: section {node}: {unknown(node, READ)}")
            sections[node] = sections.get(node, {}) | values
    found = profile_of(sections, files[-1], vehicle)
    return replace(found, name="+".join(file.stem for file in files))


def _misspelt(node: str) -> bool:
    """Return whether a section's name means a node of a profile: misson, but not my_mission."""
    own = any(f"_{one}_" in f"_{node}_" for one in READ)
    return not own and bool(get_close_matches(node, READ, 1, LIKE))


def _shared(
    file: Path,
    found: dict[str, dict[str, Any]],
    before: Mapping[str, Mapping[str, Any]],
    vehicle: VehicleDescription | None,
) -> list[tuple[str, dict[str, Any]]]:
    """Take the section of every node from those `found`; return its values for each node.

    before: the sections that these replace. A node has the values whose names it has; a name that
    no node has is refused. Raises ProfileError.
    """
    shared, rows, known = found.pop(EVERY_NODE, {}), [], set()
    for node in NODES if shared else ():
        merged = {**before.get(node, {}), **shared, **found.get(node, {})}
        try:
            kind, _ = parameter_set(node, merged, vehicle)
        except ParameterError as error:
            raise ProfileError(f"{file}: {node}: {error}") from None
        has = (*kind.specs(), *FLIGHT_OWN[node])
        known.update(has)
        rows.append((node, {name: value for name, value in shared.items() if name in has}))
    if unknown := [name for name in shared if name not in known]:
        raise ProfileError(
            f"{file}: '/**': {unknown[0]} is no parameter of {', '.join(NODES)}; name its node"
        )
    return rows


def default_profile(law: str, vehicle: VehicleDescription | None = None) -> Profile:
    """Return the profile of `law` for flights without a named profile; raises ProfileError.

    vehicle: None for the default one; its description may name a profile for the law.

    A law without its own profile uses the default law's values for the parameters that both laws
    have (same name, meaning, unit and range), and defaults for the others. What the vehicle names
    for a law that is not the default one replaces single parameters of these.
    """
    vehicle = vehicle or load_description()
    if not vehicle.profile(catalogue.DEFAULT):
        raise ProfileError(f"{vehicle.file}: no profile: uam vehicle design {vehicle.source}")
    for named in vehicle.profiles:
        if named not in catalogue.LAWS:
            raise ProfileError(
                f"{vehicle.file}: profiles.{named}: {unknown(named, catalogue.LAWS)}"
            )
    if complete := complete_profile(law, vehicle):
        return load_profile(complete, vehicle=vehicle)
    sections = dict(default_profile(catalogue.DEFAULT, vehicle).sections)
    for node in CONTROLLERS:
        known = parameter_set(node, {}, vehicle)[0].specs()
        specs = parameter_set(node, {"law": law}, vehicle)[0].specs()
        shared = {k: v for k, v in sections[node].items() if specs.get(k) == known[k]}
        sections[node] = {"law": law} | shared
    if part := vehicle.profile(law):
        return load_profile(part, vehicle=vehicle, onto=sections)
    return replace(profile_of(sections, Path(f"law {law}"), vehicle, NEEDS_PROFILE), name=law)


def complete_profile(law: str, vehicle: VehicleDescription) -> str:
    """Return the name of the law's own profile that stands for itself, "" for none.

    What a vehicle names for a law that is not the default one does not, see `default_profile`.
    """
    if (named := vehicle.profile(law)) and law != catalogue.DEFAULT:
        return ""
    return named or catalogue.law(law).profile


def _file(name_or_file: str) -> Path:
    file = Path(name_or_file)
    if file.suffix in (".yaml", ".yml"):
        return file
    try:
        return configuration.path(f"profiles/{name_or_file}.yaml")
    except configuration.ConfigurationError as error:
        raise ProfileError(str(error)) from None


def reference_limits(
    position: PositionLimits, attitude: AttitudeLimits, bridge: Mapping[str, Any]
) -> dict[str, float]:
    """Return the limits of the mission's reference that follow from other nodes' limits.

    bridge: its raw parameters. Raises ParameterError for a `rate_limit` that is not valid.
    """
    roll, pitch, yaw = RateLimits.among(bridge).rate_limit
    limits = {
        "reference_thrust": position.thrust_max,
        "reference_tilt": position.tilt_max,
        "reference_body_rate": FOLLOWED * min(roll, pitch),
        "reference_yaw_rate": FOLLOWED * yaw,
    }
    if inertia := getattr(attitude, "inertia", ()):  # laws of users may have none
        turns = np.divide(attitude.torque_max, inertia)[: YAW - ROLL]
        limits["reference_turn"] = TURNED * float(turns.min())
        limits["reference_yaw_torque"] = TURNED * float(attitude.torque_max[YAW - ROLL])
    return limits | jog_limits(attitude)


def jog_limits(attitude: AttitudeLimits) -> dict[str, float]:
    """Return speeds and stop of a jog after which the hand rests in time.

    A base stops by its tilt. Slower stops of it come too late, quicker ones swing the hand. What is
    left of the speed falls with the square of the attitude's bandwidth (docs/end_effector.md).
    """
    first, second = (getattr(attitude, f"lambda_{i}", ()) for i in (1, 2))
    if not first or not second:  # laws of others have other gains
        return {}
    bandwidth, p = float(np.divide(first, second)[: YAW - ROLL].min()), MissionParameters
    times = (bandwidth * (RESTS_AFTER - p.jog_hold)) ** 2
    found = {name: min(times * rest, getattr(p, name)) for name, rest in RESTING.items()}
    found["jog_stop"] = STOPS / bandwidth
    bounds = {name: p.specs()[name] for name in found}
    return {name: min(max(found[name], one.low), one.high) for name, one in bounds.items()}


def profile_of(
    sections: dict[str, dict[str, Any]],
    file: Path,
    vehicle: VehicleDescription | None = None,
    advice: str = WHOLE_FIRST,
) -> Profile:
    """Return the checked profile of the raw `sections`; raises ProfileError.

    file: named in the profile and in errors; vehicle: see `load_profile`; advice: for a missing
    parameter.
    """
    sets, vehicle = {}, vehicle or load_description()
    given = {node: sections.get(node, {}).get("law", catalogue.DEFAULT) for node in CONTROLLERS}
    _check_whole(file, {node: str(law) for node, law in given.items()})
    derived = derived_parameters(vehicle)
    if ESTIMATOR in sections:
        try:
            sections = sections | {ESTIMATOR: estimators.own_values(sections[ESTIMATOR])}
        except ParameterError as error:
            raise ProfileError(f"{file}: {ESTIMATOR}: {error}") from None
    for node in NODES:
        aside = FLIGHT_OWN.get(node, ())
        values = {k: v for k, v in sections.get(node, {}).items() if k not in aside}
        values = derived.get(node, {}) | values
        try:
            if node == MISSION:
                bases = sets["position_controller"], sets["attitude_controller"]
                values = reference_limits(*bases, sections.get(BRIDGE, {})) | values
            kind, axes = parameter_set(node, values, vehicle)
            sets[node] = kind.from_mapping(values, len(axes))
        except MissingParameter as error:
            text = f"{file}: {node}: {error}; {advice.format(file.name)}"
            raise ProfileError(text) from None
        except ParameterError as error:
            raise ProfileError(f"{file}: {node}: {error}") from None
    return Profile(file.stem, file, vehicle, sets, sections)


def _check_whole(file: Path, laws: Mapping[str, str]) -> None:
    """Refuse a law of the whole body that only some controllers have; laws: controller → law."""
    for node, law in laws.items():
        other = next((one for one in laws if laws[one] != law), None)
        if other and law in catalogue.LAWS and catalogue.LAWS[law].whole:
            raise ProfileError(
                f"{file}: {node}: law: {law} is one law of all three controllers, but {other} has "
                f"{laws[other]}"
            )
