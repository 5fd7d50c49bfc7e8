"""Whether the vehicle can stand as a flight begins and ends: its arm above its feet, and beside
what stands around it."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from uam_control.coordinates import ARM, CHI
from uam_control.mission import Scenario, ScenarioError
from uam_control.mission.motion.trajectory import reference_rows
from uam_control.mission.scenarios.scenario import standing
from uam_control.vehicle import VehicleDescription, VehicleError
from uam_sim_bridge.plant.arm_geometry import room_below
from uam_sim_bridge.plant.engines import DEFAULT_PLANT
from uam_sim_bridge.plant.surroundings import overlapping
from uam_sim_bridge.plant.vehicle import Vehicle

SINKS = 0.005  # [m] by which an arm may reach below the feet: a gear and a floor give way


def check(vehicle: VehicleDescription, scenario: Scenario, plant: str = DEFAULT_PLANT) -> None:
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
    start = standing(scenario.arm_start)
    flown = scenario.begun_at(start)
    end = flown.landing.end
    last = reference_rows(flown.trajectory(start), np.array([end]), len(vehicle.joints))
    told = ScenarioError, f"scenario {scenario.name}:"
    for (error, where), what, angles in (
        ((VehicleError, f"{vehicle.file}: joints:"), "stowed", vehicle.stowed),
        (told, "arm_start", scenario.arm_start),
        (told, "landing", last[CHI, 0, ARM]),
    ):
        room = room_below(model, vehicle.joint_names, angles)
        if room is not None and room < -SINKS:
            raise error(
                f"{where} {what}: with joints at {_degrees(angles)} deg the arm reaches "
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


def _degrees(angles: Sequence[float]) -> str:
    return ", ".join(f"{angle:.0f}" for angle in np.degrees(angles) + 0.0)
