"""Whether a vehicle stands free as a flight begins and ends, and how near its reference comes.

On the ground its arm is above its feet, and beside what stands around it.
"""

import math
from collections.abc import Iterator, Sequence

import mujoco
import numpy as np

from uam_control.coordinates import ARM, CHI, CHI_DDOT, POSITION, YAW, Z
from uam_control.grasp import grasp_windows
from uam_control.grasp.sight import hand_and_levers
from uam_control.maths.rotations import quaternion_from_euler
from uam_control.mission import Scenario, ScenarioError
from uam_control.mission.motion.flatness import attitudes
from uam_control.mission.motion.trajectory import reference_rows
from uam_control.mission.scenarios.environment import PAYLOAD, default_environment
from uam_control.mission.scenarios.scenario import STANDING
from uam_control.vehicle import VehicleDescription, VehicleError, chain_of
from uam_sim_bridge.plant.arm_geometry import BASE, room_below
from uam_sim_bridge.plant.plant import DEFAULT_PLANT
from uam_sim_bridge.plant.surroundings import VEHICLE, Entry, distance, overlapping, shapes
from uam_sim_bridge.plant.vehicle import Vehicle

STEP = 0.05  # [s] between two poses
MOST = 4000  # poses of a long flight
NEAR = 0.05  # [m] that the errors of a flight may need
BESIDE = 0.04  # [m] of a tool from where it grips, that its alignment with a payload mends
GRIPS = 10.0, 8.0  # [s] before and after a switch of the gripper: it works at what stands there
SINKS = 0.005  # [m] by which an arm may reach below the feet: a gear and a floor give way


def check_standing(
    vehicle: VehicleDescription, scenario: Scenario, plant: str = DEFAULT_PLANT
) -> None:
    """Raise VehicleError or ScenarioError if the arm reaches through the ground.

    Checked are the stowed arm, that of the take-off and that of the landing. An MJCF that does not
    compile is refused, too; a plant that is not MuJoCo's may accept it.
    """
    try:
        model = Vehicle.of(vehicle).compile(0.0)
    except VehicleError:
        if plant == DEFAULT_PLANT:
            raise
        return
    _check_surroundings(vehicle, scenario)
    flown, path = scenario.from_origin()
    last = reference_rows(path, np.array([flown.landing.end]), len(vehicle.joints))
    told = ScenarioError, f"scenario {scenario.name}:"
    for (error, where), what, angles in (
        ((VehicleError, f"{vehicle.file}: joints:"), "stowed", vehicle.stowed),
        (told, "arm_start", scenario.arm_start),
        (told, "landing", last[CHI, 0, ARM]),
    ):
        room = room_below(model, vehicle.joint_names, angles)
        if room is not None and room < -SINKS:
            at = ", ".join(f"{angle:.0f}" for angle in np.degrees(angles) + 0.0)
            raise error(
                f"{where} {what}: with joints at {at} deg the arm reaches "
                f"{-room:.3f} m below the feet; it must stay above them on the ground"
            )


def _check_surroundings(vehicle: VehicleDescription, scenario: Scenario) -> None:
    """Raise ScenarioError if entries of `environment` intersect each other or the vehicle."""
    if not scenario.environment:
        return
    model = Vehicle.of(vehicle).changed(scenario.surroundings).compile(0.0)
    data = mujoco.MjData(model)
    for name, angle in zip(vehicle.joint_names, scenario.arm_start, strict=True):
        data.joint(name).qpos = angle
    found = overlapping(model, data, scenario.environment, SINKS)
    if found is not None:
        one, other, depth = found
        raise ScenarioError(
            f"scenario {scenario.name}: environment: {one} and {other} intersect by {depth:.3f} m"
        )


def notes(vehicle: VehicleDescription, scenario: Scenario, mass: float) -> tuple[str, ...]:
    """Return notes about what the reference leads through, or passes within NEAR, and about a tool
    that does not close at the payload of `mass` [kg].

    Not judged: what is near the vehicle at take-off and landing, a grip, and a plant whose model is
    not MuJoCo's.
    """
    entries = scenario.environment
    entries = default_environment() if entries is None else entries
    if not entries:
        return ()
    try:
        model = Vehicle.of(vehicle).changed(scenario.surroundings).compile(0.0)
    except VehicleError:
        return ()
    found = [_near(model, entries, vehicle, scenario)]
    payload = next((entry for entry in entries if entry["kind"] == PAYLOAD), None)
    if mass and payload is not None:
        found.append(_beside(model, payload, vehicle, scenario))
    return tuple(filter(None, found))


def _beside(
    model: mujoco.MjModel, payload: Entry, vehicle: VehicleDescription, scenario: Scenario
) -> str:
    """Return a note about a tool that first closes farther than BESIDE from where it grips."""
    (flown, path), chain = scenario.from_origin(), chain_of(vehicle)
    windows = grasp_windows(flown.motions, flown.magnet, dict(flown.approaches))
    if not windows or not chain.has_hand:
        return ""
    window, data = windows[0], mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    place = data.body(PAYLOAD).xpos + [0.0, 0.0, payload["size"][2] / 2] + window.approach.point
    rows = reference_rows(path, np.array([window.grip]), len(vehicle.joints))
    off = hand_and_levers(chain, rows[CHI, 0])[0] - place
    if (far := float(np.linalg.norm(off))) < BESIDE:
        return ""
    x, y, z = off
    return (
        f"at {window.grip:.1f} s the tool of {vehicle.name} closes {far:.2f} m from the payload: "
        f"x {x:+.2f}, y {y:+.2f}, z {z:+.2f} m too far"
    )


def _near(
    model: mujoco.MjModel,
    entries: Sequence[Entry],
    vehicle: VehicleDescription,
    scenario: Scenario,
) -> str:
    """Return a note about what the reference leads through or passes, "" for nothing."""
    parts = shapes(model, entries)
    own = parts.pop(VEHICLE)
    load = next((entry["name"] for entry in entries if entry["kind"] == PAYLOAD), "")
    carried = min((at for at, _ in scenario.magnet), default=math.inf)
    least, where, when = NEAR, "", 0.0
    for time, data in _poses(model, vehicle, scenario):
        for name, geoms in parts.items():
            if name == load and time > carried:  # it is not where it was
                continue
            found = distance(model, data, own, geoms, NEAR)
            if found < least:
                least, where, when = found, name, time
    if not where:
        return ""
    how = f"passes {where} within {least:.2f} m" if least >= 0.0 else f"leads through {where}"
    return f"the reference {how} at {when:.1f} s; `environment: []` is an empty room"


def _poses(
    model: mujoco.MjModel, vehicle: VehicleDescription, scenario: Scenario
) -> Iterator[tuple[float, mujoco.MjData]]:
    """Yield times [s] and data of the poses of the flight that are judged."""
    flown, path = scenario.from_origin()
    end = flown.landing.at
    times = np.linspace(0.0, end, min(MOST, int(end / STEP) + 2))
    rows = reference_rows(path, times, len(vehicle.joints))
    chi, force = rows[CHI], rows[CHI_DDOT, :, POSITION] + [0.0, 0.0, vehicle.gravity]
    judged = chi[:, Z] - STANDING > NEAR
    for at, _ in flown.magnet:
        judged &= (times < at - GRIPS[0]) | (times > at + GRIPS[1])
    data, base = mujoco.MjData(model), model.joint(BASE).qposadr[0]
    turned = attitudes(force, chi[:, YAW])
    for i in np.flatnonzero(judged):
        data.qpos[base : base + 3] = chi[i, POSITION]
        data.qpos[base + 3 : base + 7] = quaternion_from_euler(turned[i])
        for name, angle in zip(vehicle.joint_names, chi[i, ARM], strict=True):
            data.joint(name).qpos = angle
        mujoco.mj_kinematics(model, data)
        yield float(times[i]), data
