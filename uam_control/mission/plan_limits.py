"""Limits that a plan keeps from its begin to its end."""

import numpy as np

from uam_control.coordinates import ARM, CHI, CHI_DDOT, CHI_DOT, POSITION, YAW, Z
from uam_control.mission.mission_parameters import MissionParameters
from uam_control.mission.plans import BASE, Plan, PlanRefused

ROUNDING = 1e-9  # [m or rad]


def room(p: MissionParameters, ground: float) -> np.ndarray:
    """Return the corners (2, 3) [m] of the base's room; ground [m]: height at take-off."""
    found = p.room(ground)
    found[0, Z] = max(found[0, Z], ground + p.airborne_height)
    return found


def check(plan: Plan, p: MissionParameters, ground: float) -> None:
    """Raise PlanRefused if the plan leaves a limit anywhere; ground [m]: height at take-off.

    A plan that begins beyond a limit of position or angle may come back, but not go further.
    """
    times = plan.samples()
    values = plan.at(times)
    if plan.columns is BASE:
        names, unit = ("x", "y", "z"), "m"
        low, high = room(p, ground)
        within = values[CHI, :, POSITION]
    else:
        names, unit = [f"alpha_{i + 1}" for i in range(values.shape[2])], "rad"
        (low, high), within = p.joint_ranges, values[CHI]
    low_now, high_now = np.minimum(low, within[0]), np.maximum(high, within[0])
    for i, name in enumerate(names):
        beyond = np.maximum(low_now[i] - within[:, i], within[:, i] - high_now[i])
        k, end = int(np.argmax(beyond)), within[-1, i]
        if not low[i] - ROUNDING <= end <= high[i] + ROUNDING:
            k = len(times) - 1
        elif beyond[k] <= ROUNDING:
            continue
        raise PlanRefused(
            f"{name} is {within[k, i]:.2f} {unit} after {times[k]:.1f} s, "
            f"allowed {low[i]:g} to {high[i]:g} {unit}"
        )
    for what, found, limit, unit in _rates(plan, values, p):
        k = int(np.argmax(found))
        if found[k] > limit:
            raise PlanRefused(
                f"{what} is {found[k]:.2f} {unit} after {times[k]:.1f} s, allowed {limit:g} {unit}"
            )


def _rates(plan: Plan, values: np.ndarray, p: MissionParameters) -> list[tuple]:
    """Return (quantity, values (q,), limit, unit) of the rates of a plan's samples (3, q, k)."""
    if plan.columns is ARM:
        rate, acceleration = (np.abs(values[row]).max(axis=1) for row in (CHI_DOT, CHI_DDOT))
        return [
            ("joint rate", rate, p.plan_joint_rate, "rad/s"),
            ("joint acceleration", acceleration, p.plan_joint_acceleration, "rad/s^2"),
        ]
    speed, acceleration = (
        np.linalg.norm(values[row, :, POSITION], axis=1) for row in (CHI_DOT, CHI_DDOT)
    )
    yaw_rate, yaw_acceleration = (np.abs(values[row, :, YAW]) for row in (CHI_DOT, CHI_DDOT))
    return [
        ("speed", speed, p.plan_speed, "m/s"),
        ("acceleration", acceleration, p.plan_acceleration, "m/s^2"),
        ("yaw rate", yaw_rate, p.plan_yaw_rate, "rad/s"),
        ("yaw acceleration", yaw_acceleration, p.plan_yaw_acceleration, "rad/s^2"),
    ]
