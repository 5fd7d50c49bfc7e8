"""Parameters of the nodes that follow from a vehicle's numbers."""

import math
from typing import Any

from uam_control.arm.chain import as_parameters
from uam_control.vehicle.chain_reader import chain_of
from uam_control.vehicle.description import AXES, VehicleDescription
from uam_control.vehicle.gripper import MAGNET, TWO_FINGER, Gripper
from uam_control.vehicle.loading import VehicleError

# measured loop delay of a link without delay: share of the control period, and [s]; all vehicles of
# config/vehicle and designs at 2 to 8 ms, 2026-11-29
PERIODS, LESS = 3.6, 0.0074
ANGLE_STEP = 0.05  # [rad] the supervisor's limits: joint ranges, rounded down to this step


def derived_parameters(vehicle: VehicleDescription) -> dict[str, dict[str, Any]]:
    """Return the node parameters derived from the vehicle; a profile can replace them.

    Raises VehicleError for a vehicle without gains of its autopilot.
    """
    if not vehicle.autopilot_gains:
        raise VehicleError(
            f"{vehicle.file}: no gains of the autopilot: uam vehicle design {vehicle.source}"
        )
    arm = as_parameters(chain_of(vehicle))
    load = arm | {"arm_gravity": vehicle.gravity} | _load_friction(vehicle)
    drag = [round(drag / vehicle.mass, 6) for drag in vehicle.numbers["air"]["drag"]]
    nominal = round(max(0.0, PERIODS * vehicle.control_period - LESS), 6)
    return {
        "state_estimator": {"gravity": vehicle.gravity},
        "position_controller": {
            "gravity": vehicle.gravity,
            "gravity_feedforward_mass": vehicle.mass,
            "drag_feedforward": drag,
        },
        "attitude_controller": {
            "feedforward_washout": _integral_ratios(vehicle),
            "prediction_nominal": nominal,
        }
        | load,
        "arm_controller": load,
        "mission": {
            "delay_nominal": nominal,
            "gravity": vehicle.gravity,
            "drag": drag,
            "joint_angle_hold": [
                round(math.floor(0.5 * (joint.high - joint.low) / ANGLE_STEP) * ANGLE_STEP, 9)
                for joint in vehicle.joints
            ],
            "joint_angle_middle": [
                round(0.5 * (joint.low + joint.high), 6) for joint in vehicle.joints
            ],
            "joint_effort_hold": [servo.effort_limit for servo in vehicle.servos],
            **_grip(vehicle.gripper),
            **arm,
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


def _load_friction(vehicle: VehicleDescription) -> dict[str, list[float]]:
    """Return the friction of the joints per torque, where their servos have one."""
    servos = map(vehicle.servo_numbers, range(len(vehicle.joints)))
    shares = [float(one.get("load_friction", 0.0)) for one in servos]
    return {"joint_load_friction": shares} if any(shares) else {}


def _grip(gripper: Gripper) -> dict[str, Any]:
    """Return what the executive of the grasps knows of a gripper that is no magnet."""
    if gripper.kind != TWO_FINGER:
        return {} if gripper.kind == MAGNET else {"gripper": gripper.kind}
    return {
        "gripper": gripper.kind,
        "gripper_opening": list(gripper.opening),
        "gripper_force": gripper.force,
        "press_depth": gripper.grip_depth,
    }


def _integral_ratios(vehicle: VehicleDescription) -> list[float]:
    """Return I/P of the autopilot's rate loop about roll, pitch, yaw [1/s]."""
    gains = vehicle.autopilot_gains
    pairs = [(gains.get(f"MC_{axis}RATE_I", 0.0), gains[f"MC_{axis}RATE_P"]) for axis in AXES]
    return [round(integral / proportional, 6) for integral, proportional in pairs]
