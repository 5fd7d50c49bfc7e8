"""Parameters of the nodes that follow from a vehicle's numbers."""

from __future__ import annotations

import math
from typing import Any

from uam_control.vehicle.arm_model import ArmModel, UnreadableModel
from uam_control.vehicle.description import AXES, VehicleDescription
from uam_control.vehicle.loading import VehicleError

ANGLE_STEP = 0.05  # [rad] the supervisor's limits: joint ranges, rounded down to this step


def derived_parameters(vehicle: VehicleDescription) -> dict[str, dict[str, Any]]:
    """Return the node parameters derived from the vehicle; a profile can replace them."""
    drag = [round(drag / vehicle.mass, 6) for drag in vehicle.numbers["air"]["drag"]]
    return {
        "state_estimator": {"gravity": vehicle.gravity},
        "position_controller": {
            "gravity": vehicle.gravity,
            "gravity_feedforward_mass": vehicle.mass,
            "drag_feedforward": drag,
        },
        "attitude_controller": {"feedforward_washout": _integral_ratios(vehicle)} | _load(vehicle),
        "arm_controller": _load(vehicle),
        "mission": {
            "gravity": vehicle.gravity,
            "drag": drag,
            "joint_angle_hold": [
                _rounded_down(min(-joint.low, joint.high)) for joint in vehicle.joints
            ],
            "joint_effort_hold": [vehicle.servo.effort_limit] * len(vehicle.joints),
            **_arm_parameters(vehicle),
        },
        "mavlink_bridge": {
            "rotor_thrust_max": vehicle.rotor_thrust,
            "motor_curve_factor": vehicle.rotor.curve_factor,
            "thr_mdl_fac": vehicle.rotor.curve_factor,
            "identification_mass": vehicle.mass,
            "rate_p": [vehicle.autopilot_gains[f"MC_{axis}RATE_P"] for axis in AXES],
            "rate_k": [vehicle.autopilot_gains.get(f"MC_{axis}RATE_K", 1.0) for axis in AXES],
        },
    }


def _integral_ratios(vehicle: VehicleDescription) -> list[float]:
    """Return I/P of the autopilot's rate loop about roll, pitch, yaw [1/s]."""
    gains = vehicle.autopilot_gains
    pairs = [(gains.get(f"MC_{axis}RATE_I", 0.0), gains[f"MC_{axis}RATE_P"]) for axis in AXES]
    return [round(integral / proportional, 6) for integral, proportional in pairs]


def _load(vehicle: VehicleDescription) -> dict[str, Any]:
    """Return the parameters of the arm's load; {} for an arm that is not planar."""
    try:
        arm = ArmModel.of(vehicle)
    except UnreadableModel:
        raise
    except VehicleError:
        return {}
    return arm.planar(vehicle.gravity)


def _arm_parameters(vehicle: VehicleDescription) -> dict[str, Any]:
    if vehicle.arm is None:
        return {}
    mount, links = list(vehicle.arm.mount), list(vehicle.arm.links)
    return {"arm_mount": mount, "arm_links": links, "magnet_length": vehicle.arm.magnet}


def _rounded_down(angle: float) -> float:
    return round(math.floor(angle / ANGLE_STEP) * ANGLE_STEP, 9)
