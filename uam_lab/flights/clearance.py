"""How near the reference brings the vehicle to what stands around it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import mujoco
import numpy as np

from uam_control.coordinates import ARM, CHI, CHI_DDOT, POSITION, YAW, Z
from uam_control.grasp import grasp_windows
from uam_control.grasp.kinematics import hand_and_levers
from uam_control.maths.rotations import quaternion_from_euler
from uam_control.mission import Scenario
from uam_control.mission.motion.flatness import attitudes
from uam_control.mission.motion.trajectory import reference_rows
from uam_control.mission.scenarios.environment import PAYLOAD, default_environment
from uam_control.mission.scenarios.scenario import standing
from uam_control.vehicle import VehicleDescription, VehicleError, chain_of
from uam_sim_bridge.plant.arm_geometry import BASE
from uam_sim_bridge.plant.surroundings import VEHICLE, Entry, distance, shapes
from uam_sim_bridge.plant.vehicle import Vehicle

STEP = 0.05  # [s] between two poses
MOST = 4000  # poses of a long flight
NEAR = 0.05  # [m] that the errors of a flight may need
BESIDE = 0.04  # [m] of a tool from where it grips, that its alignment with a payload mends
GRIPS = 10.0, 8.0  # [s] before and after a switch of the gripper: it works at what stands there


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
    start, chain = standing(scenario.arm_start), chain_of(vehicle)
    flown = scenario.begun_at(start)
    windows = grasp_windows(flown.motions, flown.magnet, dict(flown.approaches))
    if not windows or not chain.has_hand:
        return ""
    window, data = windows[0], mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    place = data.body(PAYLOAD).xpos + [0.0, 0.0, payload["size"][2] / 2] + window.approach.point
    times = np.array([window.grip])
    rows = reference_rows(flown.trajectory(start), times, len(vehicle.joints))
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
    start = standing(scenario.arm_start)
    flown = scenario.begun_at(start)
    end = flown.landing.at
    times = np.linspace(0.0, end, min(MOST, int(end / STEP) + 2))
    rows = reference_rows(flown.trajectory(start), times, len(vehicle.joints))
    chi, force = rows[CHI], rows[CHI_DDOT, :, POSITION] + [0.0, 0.0, vehicle.gravity]
    judged = chi[:, Z] - start[Z] > NEAR
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
