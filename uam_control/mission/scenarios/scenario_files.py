"""Scenario files: YAML (config/scenarios), or CSV trajectories."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from uam_control.coordinates import BASE_COORDINATES, arm_coordinates
from uam_control.grasp.windows import Approach
from uam_control.mission.motion.trajectory import Move
from uam_control.mission.scenarios import hand_kind
from uam_control.mission.scenarios.csv_file import from_csv
from uam_control.mission.scenarios.environment import ENVIRONMENT, read_environment
from uam_control.mission.scenarios.reference_kinds import KINDS, Middle, legs
from uam_control.mission.scenarios.route import Route
from uam_control.mission.scenarios.scenario import (
    Landing,
    Scenario,
    ScenarioError,
    check_length,
    standing,
)
from uam_control.mission.scenarios.scenario_options import (
    AS_SCENARIO,
    LAND,
    RETURN,
    ScenarioOptions,
)
from uam_control.settings import configuration
from uam_control.settings.section import Section, read_section
from uam_control.vehicle import NO_GRIPPER, VehicleDescription, load_description

T = TypeVar("T")
SHORTEST = 1e-3  # [s] of a move or of the landing

KEYS = (
    *("description", "arm_start", "phases", "moves", "trajectory", "end", "magnet", "gripper"),
    *("payload", "landing", "snapshots", "faults", ENVIRONMENT),
)


def load_scenario(
    name_or_file: str,
    vehicle: VehicleDescription | None = None,
    options: ScenarioOptions | None = None,
) -> Scenario:
    """Return a scenario by name, or from a .yaml or .csv file; raises ScenarioError.

    vehicle: that it is for, None for the default one; options: None for the defaults.
    """
    vehicle, options = vehicle or load_description(), options or ScenarioOptions()
    try:
        file = configuration.named("scenarios", name_or_file)
    except configuration.ConfigurationError as error:
        raise ScenarioError(str(error)) from None
    read = FORMS.get(file.suffix.lower())
    if read is None:
        raise ScenarioError(f"{file}: a name that ends in {', '.join(FORMS)} expected")
    scenario = read(file, vehicle, options).slowed(options.slowdown)
    check_length(scenario.landing.end, f"{file}: the flight")
    if any(on for _, on in scenario.magnet) and vehicle.gripper.kind == NO_GRIPPER:
        raise ScenarioError(
            f"{file}: magnet: {vehicle.name} has no gripper; allowed: a scenario without"
        )
    return scenario


def from_yaml(file: Path, vehicle: VehicleDescription, options: ScenarioOptions) -> Scenario:
    """Read a scenario file; see docs/scenarios.md for the form.

    Without arm_start the arm begins stowed.
    """
    top = read_section(file, ScenarioError)
    top.only(KEYS)
    arm_start = _arm_start(top, vehicle)
    timed = "landing" in top.values or "moves" in top.values
    if "trajectory" in top.values and not timed:
        return _along_route(file, top, arm_start, vehicle, options)
    if "end" in top.values:
        raise top.error("end", "only for a trajectory without moves and landing")
    phases = _timeline(top, "phases", "from", "name", Section.text)
    if phases and phases[0][0] > 0.0:
        raise top.error("phases", f"the first begins at {phases[0][0]:g} s, it must begin at 0")
    payload = top.section("payload") if top.values.get("payload") is not None else None
    if payload is not None:
        payload.only(("mass", "drop_point"))
    faults = top.values.get("faults") or []
    if not isinstance(faults, list):
        raise ScenarioError(f"{file}: 'faults' is not a list")
    entry = top.section("landing")
    entry.only(("at", "duration"))
    landing = Landing(entry.not_negative("at"), entry.positive("duration"))
    if landing.duration < SHORTEST:
        raise entry.error("duration", f"{landing.duration:g} s is below {SHORTEST:g} s")
    scenario = Scenario(
        name=file.stem,
        description=top.text("description", default=""),
        arm_start=arm_start,
        phases=phases or ((0.0, "flight"),),
        landing=landing,
        moves=_moves(top, vehicle, landing),
        **_grips(top),
        payload_mass=payload.not_negative("mass") if payload else 0.0,
        drop_point=(
            payload.numbers("drop_point", 2) if payload and "drop_point" in payload.values else None
        ),
        snapshots=_timeline(top, "snapshots", "at", "caption", Section.text),
        faults=tuple(faults),
        environment=read_environment(top),
    )
    if "trajectory" not in top.values:
        return scenario
    return _with_trajectory(scenario, top, vehicle, options)


def _along_route(
    file: Path,
    top: Section,
    arm_start: tuple[float, ...],
    vehicle: VehicleDescription,
    options: ScenarioOptions,
) -> Scenario:
    """Return the scenario that consists of a trajectory and the ways to it and from it."""
    for key in top.values:
        if key not in ("description", "arm_start", "trajectory", "end", ENVIRONMENT):
            raise top.error(key, "not together with a trajectory alone; give moves and landing")
    end = top.one_of("end", (RETURN, LAND), default=RETURN)
    end = end if options.end == AS_SCENARIO else options.end
    entry = top.section("trajectory")
    if "at" in entry.values:
        raise entry.error("at", "only with moves and landing")
    start = standing(arm_start)
    if entry.one_of("kind", (*KINDS, hand_kind.KIND)) == hand_kind.KIND:
        source = hand_kind.hand_source(entry, vehicle, file.parent)
        route = Route(source.legs(), end, options, source=source)
    else:
        route = Route(legs(entry, _middle(start, vehicle)), end, options)
    scenario = Scenario(
        name=file.stem,
        description=top.text("description", default=""),
        arm_start=arm_start,
        phases=(),
        landing=Landing(0.0, 0.0),
        route=route,
        environment=read_environment(top),
    )
    return scenario.begun_at(start)


def _middle(chi: np.ndarray, vehicle: VehicleDescription) -> Middle:
    return Middle(chi.copy(), tuple((joint.low, joint.high) for joint in vehicle.joints))


def _with_trajectory(
    scenario: Scenario, top: Section, vehicle: VehicleDescription, options: ScenarioOptions
) -> Scenario:
    """Return the scenario with its trajectory, which begins where the moves are at `at`."""
    entry = top.section("trajectory")
    at = entry.not_negative("at")
    for key in ("height", "centre", "arm_deg"):
        if key in entry.values:
            raise entry.error(key, "not with at: the trajectory begins where the moves are")
    pieces = legs(entry, _middle(standing(scenario.arm_start), vehicle))
    route = Route(pieces, RETURN, options)
    path = route.path
    apart = float(np.abs(path.last - path.first)[:3].max())
    if apart > 1e-6:
        raise entry.error("at", f"the trajectory ends {apart:.3g} m from its begin, 0 m allowed")
    end = at + path.length
    for i, move in enumerate(scenario.moves):
        if move.coordinate in BASE_COORDINATES and move.start < end and move.end > at:
            raise top.error(
                f"moves[{i}]",
                f"{move.coordinate} moves during the trajectory, from {at:g} to {end:g} s",
            )
    if scenario.landing.at < end:
        raise top.error(
            "landing", f"at {scenario.landing.at:g} s, the trajectory ends at {end:g} s"
        )
    begin, phases = at, list(scenario.phases)
    for leg in pieces:
        phases.append((begin, leg.phase))
        begin += leg.path.length
    phases.append((end, scenario.phase(at)))
    return replace(
        scenario, route=route, route_at=at, phases=tuple(sorted(phases, key=lambda p: p[0]))
    )


def _arm_start(top: Section, vehicle: VehicleDescription) -> tuple[float, ...]:
    """Return the joint angles [rad] on the ground: `arm_start`, or stowed."""
    if "arm_start" not in top.values:
        return vehicle.stowed
    arm, joints = top.section("arm_start"), arm_coordinates(len(vehicle.joints))
    expected = [f"{name}_deg" for name in joints]
    for name in arm.values:
        if name not in expected:
            has = f"{vehicle.name} has: {', '.join(expected)}"
            raise ScenarioError(f"{arm.where}.{name}: no joint; {has}")
    return tuple(_angle(arm, f"{name}_deg", name, vehicle) for name in joints)


def _angle(entry: Section, key: str, coordinate: str, vehicle: VehicleDescription) -> float:
    """Return an angle [rad]; a joint's must be within its range."""
    angle = math.radians(entry.number(key))
    joints = dict(zip(arm_coordinates(len(vehicle.joints)), vehicle.joints, strict=True))
    joint = joints.get(coordinate)
    if joint is not None and not joint.low <= angle <= joint.high:
        raise ScenarioError(
            f"{entry.where}.{key}: {entry.values[key]:g}; {vehicle.name} allows "
            f"{math.degrees(joint.low):g} to {math.degrees(joint.high):g}"
        )
    return angle


def _grips(top: Section) -> dict[str, tuple]:
    """Return when the gripper closes (True) and opens, and how it comes to the payload.

    In the list `gripper`, or `magnet` of a magnet.
    """
    key, word = ("gripper", "closed") if "gripper" in top.values else ("magnet", "energised")
    if key == "gripper" and "magnet" in top.values:
        raise top.error(key, "not together with magnet, which says the same")
    how = Approach._fields
    switches = _timeline(top, key, "at", word, Section.switch, how)
    entries = zip(switches, top.entries(key, True), strict=True)
    given = ((at, _approach(entry)) for (at, _), entry in entries if entry.values.keys() & set(how))
    return {"magnet": switches, "approaches": tuple(given)}


def _approach(entry: Section) -> Approach:
    usual = Approach()
    way = np.array(entry.numbers("direction", 3, default=usual.direction))
    if not way.any():
        raise entry.error("direction", "[0, 0, 0]: the way of the tool to the payload, x y z")
    point = entry.numbers("point", 3, default=usual.point)
    return Approach(tuple((way / np.linalg.norm(way)).tolist()), point)


def _timeline(
    top: Section,
    key: str,
    time: str,
    name: str,
    value: Callable[[Section, str], T],
    further: Sequence[str] = (),
) -> tuple[tuple[float, T], ...]:
    """Return the entries of the list `key` as (time [s], value); the times must increase.

    time, name: of the two entries of each; value: reads the second; further: names of others.
    """
    found: list[tuple[float, T]] = []
    for entry in top.entries(key, True):
        entry.only((time, name, *further))
        at = entry.not_negative(time)
        if found and at <= found[-1][0]:
            raise entry.error(time, f"{at:g} s is not after the entry before, {found[-1][0]:g} s")
        found.append((at, value(entry, name)))
    return tuple(found)


def _moves(top: Section, vehicle: VehicleDescription, landing: Landing) -> tuple[Move, ...]:
    """Return `moves`; angles are in degrees.

    Moves of one coordinate must not overlap in time. The vehicle is at rest when the landing
    begins, the arm when it ends.
    """
    moves = tuple(_move(entry, vehicle) for entry in top.entries("moves", True))
    last: dict[str, Move] = {}
    for i, move in enumerate(moves):
        base = move.coordinate in BASE_COORDINATES
        latest = landing.at if base else landing.end
        if move.end > latest:
            what = "landing begins" if base else "landing ends"
            raise top.error(f"moves[{i}].until", f"{move.end:g} s, but the {what} at {latest:g} s")
    for move in sorted(moves, key=lambda m: m.start):
        before = last.get(move.coordinate)
        if before and before.end > move.start:
            raise ScenarioError(
                f"{top.where} two moves of {move.coordinate} overlap at {move.start} s"
            )
        last[move.coordinate] = move
    return moves


def _move(entry: Section, vehicle: VehicleDescription) -> Move:
    allowed = [c for c in vehicle.coordinates if c not in ("roll", "pitch")]
    coordinate = entry.one_of("coordinate", allowed)
    length = coordinate in ("x", "y", "z")
    entry.only(("coordinate", "from", "until", "to" if length else "to_deg"))
    target = entry.number("to") if length else _angle(entry, "to_deg", coordinate, vehicle)
    start, end = entry.not_negative("from"), entry.number("until")
    if end - start < SHORTEST:
        raise entry.error("until", f"{end:g} s is not {SHORTEST:g} s after from, {start:g} s")
    return Move(coordinate, start, end, target)


FORMS = {".yaml": from_yaml, ".yml": from_yaml, ".csv": from_csv}
