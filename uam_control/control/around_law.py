"""What a controller computes around its law at a tick: one compiled call before it, one after it.

The steps themselves are in `tracking_errors`, `output_limits`, `arm_load`, `thrust_direction`.
"""

from __future__ import annotations

import numpy as np

from uam_control.control.arm_load import arm_load
from uam_control.control.output_limits import (
    ForceCompletion,
    complete_and_limit,
    complete_effort,
    lead_attitude,
    limit_torque,
)
from uam_control.control.thrust_direction import attitude_reference_step
from uam_control.coordinates import ALPHA
from uam_control.laws.errors import FEEDFORWARD, E, tracking_errors
from uam_control.maths.compiled import jit


@jit
def begin_attitude(
    state: np.ndarray,
    reference: np.ndarray,
    attitude_reference: np.ndarray,
    flying: bool,
    printed: bool,
    arm: np.ndarray,
    loaded: bool,
    inertia: float,
    ahead: float,
    corner: np.ndarray,
    dt: float,
    errors: np.ndarray,
    norms: np.ndarray,
    joints: np.ndarray,
    slow: np.ndarray,
) -> None:
    """Write the errors of the attitude law: tracking errors, arm's moment, prediction.

    arm, joints (n,): record and torques of `arm_load`, used if `loaded`; inertia [kg m^2]: about
    pitch; the others: see `tracking_errors` and `lead_attitude`.
    """
    tracking_errors(state, reference, attitude_reference, flying, printed, errors, norms)
    pitch = 0.0
    if loaded:
        pitch = arm_load(arm, reference, joints) / inertia
    lead_attitude(errors, ahead, pitch, corner, dt, slow)


@jit
def end_position(
    reference: np.ndarray,
    e: np.ndarray,
    completion: ForceCompletion,
    saturated: bool,
    dt: float,
    integral: np.ndarray,
    tau: np.ndarray,
    limited: np.ndarray,
    cutoff: float,
    filtered: np.ndarray,
    lead: np.ndarray,
    attitude: np.ndarray,
) -> bool:
    """Write tau_p to limited (3,) [N, ENU] and the desired attitude to attitude (3, 3).

    The arguments are those of `complete_and_limit` and `attitude_reference_step`. Returns whether a
    limit acted.
    """
    acted = complete_and_limit(reference, e, completion, saturated, dt, integral, tau, limited)
    attitude_reference_step(limited, reference, cutoff, dt, filtered, lead, attitude)
    return acted


@jit
def end_arm(
    reference: np.ndarray,
    errors: np.ndarray,
    arm: np.ndarray,
    loaded: bool,
    inertia: np.ndarray,
    gain: np.ndarray,
    limit: float,
    torque_max: np.ndarray,
    saturated: bool,
    dt: float,
    load: np.ndarray,
    integral: np.ndarray,
    tau: np.ndarray,
    limited: np.ndarray,
) -> bool:
    """Complete the law's torques tau (n,), write them within ±torque_max to limited (n,), [N m].

    errors (3, 6 + n): see `tracking_errors`; arm, load (n,): record and torques of `arm_load`, used
    if `loaded`; the others: see `complete_effort`. Returns whether a limit acted.
    """
    if loaded:
        arm_load(arm, reference, load)
    acceleration_d, e = errors[FEEDFORWARD, ALPHA:], errors[E, ALPHA:]
    complete_effort(
        acceleration_d, e, load, loaded, inertia, gain, limit, saturated, dt, integral, tau
    )
    return limit_torque(tau, torque_max, limited)
