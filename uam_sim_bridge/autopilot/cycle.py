"""The compiled cycle of the autopilot stand-in: rate loop, allocation, and an external pose.

All vectors are FRD and NED; times [s] are those of the sensor samples.

Allocation: normalised torques and thrust → motor thrusts, as in PX4's control allocator. The mixer
is `rotor_geometry.normalised_mixer`, motor order and signs are those of PX4's CA_ROTORn. Saturation
is removed in this order (PX4: sequential desaturation, MC_AIRMODE = 0): collective down, then roll
and pitch, then yaw with a margin, then collective down again.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from uam_control.maths.compiled import borrowing, jit
from uam_control.setpoints.thrust_curve import inverse_curve
from uam_control.vehicle.rotor_geometry import PITCH, ROLL, THRUST, YAW
from uam_sim_bridge.autopilot.autopilot_estimator import GRAVITY, EstimatorArrays, fuse, predict
from uam_sim_bridge.autopilot.loops.rate_control import (
    INTEGRAL,
    TORQUE,
    UNALLOCATED,
    filter_gyro,
    rate_torque,
)

FARTHEST_VISION = 1e5  # m
HOVER_TIME, HOVER_RANGE = 1.0, 0.2  # [s] of a mean; largest change (PX4: HTE_THR_RANGE)
LEAST_LIFT = 0.3 * GRAVITY  # [m/s^2] specific force from which the thrust of hover is learned
YAW_MARGIN = 0.15  # of the motor range, kept for yaw at full thrust (PX4: minimum yaw margin)
WEAK = 0.2  # mixer entries below this do not desaturate (PX4)
SHORTEST_STEP, LONGEST_STEP = 0.000125, 0.02  # s, bounds of the time step (PX4)


class RateLoop(NamedTuple):
    """Parameters, state and output of the rate loop."""

    model_factor: float  # THR_MDL_FAC
    filters: np.ndarray  # (7,) see `rate_control`
    gains: np.ndarray  # (5, 3) see `rate_control`
    mixer: np.ndarray  # (rotors, 4)
    inverse: np.ndarray  # (4, rotors) pseudo-inverse of the mixer
    memory: np.ndarray  # (7, 3) see `rate_control`
    motors: np.ndarray  # (rotors,) output, 0..1


@borrowing
def control_tick(
    gyro: np.ndarray, dt: float, armed: bool, landed: bool, setpoint: np.ndarray, loop: RateLoop
) -> None:
    """Run one cycle of the rate loop and write the motors.

    gyro (3,) [rad/s, FRD]; dt [s]; setpoint (4,): body rates [rad/s, FRD], thrust.
    """
    filters, gains, memory, motors = loop.filters, loop.gains, loop.memory, loop.motors
    filter_gyro(gyro, dt, filters, memory)
    if not armed:
        for axis in range(3):
            memory[INTEGRAL, axis] = 0.0
            memory[TORQUE, axis] = 0.0
            memory[UNALLOCATED, axis] = 0.0
        for i in range(len(motors)):
            motors[i] = 0.0
        return
    rate_torque(setpoint, dt, filters, gains, landed, memory)
    drive_motors(setpoint[3], loop)


@borrowing
def _desaturate(
    motors: np.ndarray, mixer: np.ndarray, axis: int, upper: float, down_only: bool
) -> None:
    """Move motors (n,) along one mixer column to remove saturation, or balance it at both ends."""
    for attempt in range(2):
        low = 0.0
        high = 0.0
        for i in range(motors.shape[0]):
            entry = mixer[i, axis]
            if abs(entry) < WEAK:
                continue
            step = 0.0
            if motors[i] < 0.0:
                step = -motors[i] / entry
            elif motors[i] > upper:
                step = (upper - motors[i]) / entry
            low = min(low, step)
            high = max(high, step)
        gain = low + high
        if attempt == 0 and down_only and gain > 0.0:
            return
        if attempt == 1:
            gain *= 0.5  # the second pass removes half of the remaining saturation
        for i in range(motors.shape[0]):
            motors[i] += gain * mixer[i, axis]


@borrowing
def allocate(torque: np.ndarray, thrust: float, mixer: np.ndarray, motors: np.ndarray) -> None:
    """Write the motor thrusts 0..1 into `motors` (n,).

    torque (3,): normalised, FRD; thrust: normalised collective, up; mixer (n, 4):
    `normalised_mixer`.
    """
    count = motors.shape[0]
    for i in range(count):
        motors[i] = (
            mixer[i, ROLL] * torque[0] + mixer[i, PITCH] * torque[1] + mixer[i, THRUST] * thrust
        )
    _desaturate(motors, mixer, THRUST, 1.0, True)
    _desaturate(motors, mixer, ROLL, 1.0, False)
    _desaturate(motors, mixer, PITCH, 1.0, False)
    for i in range(count):
        motors[i] += mixer[i, YAW] * torque[2]
    _desaturate(motors, mixer, YAW, 1.0 + YAW_MARGIN, False)
    _desaturate(motors, mixer, THRUST, 1.0, True)
    for i in range(count):
        motors[i] = min(1.0, max(0.0, motors[i]))


@borrowing
def unallocated_torque(
    torque: np.ndarray, motors: np.ndarray, inverse_mixer: np.ndarray, out: np.ndarray
) -> None:
    """Write into out (3,) the part of torque (3,) that motors (n,) do not make; normalised, FRD.

    inverse_mixer (4, n): pseudo-inverse of the normalised mixer. All three are zero if the sum of
    squares is below 1e-6, as in PX4's allocator status.
    """
    total = 0.0
    for axis in range(3):
        made = 0.0
        for i in range(motors.shape[0]):
            made += inverse_mixer[axis, i] * motors[i]
        out[axis] = torque[axis] - made
        total += out[axis] * out[axis]
    if total < 1e-6:
        for axis in range(3):
            out[axis] = 0.0


@borrowing
def drive_motors(thrust: float, loop: RateLoop) -> None:
    """Write the motors for the torque in the loop's memory and a normalised thrust."""
    torque = loop.memory[TORQUE]
    allocate(torque, thrust, loop.mixer, loop.motors)
    unallocated_torque(torque, loop.motors, loop.inverse, loop.memory[UNALLOCATED])
    for i in range(len(loop.motors)):
        loop.motors[i] = inverse_curve(loop.model_factor, loop.motors[i])


@borrowing
def magnitude_of_usable(position: np.ndarray, quaternion: np.ndarray) -> float:
    """Return the norm of the quaternion of an external pose; 0 if the pose is not usable.

    position (3,) [m, NED]; quaternion (4,) [w x y z].
    """
    for i in range(3):
        if not abs(position[i]) < FARTHEST_VISION:  # true for NaN
            return 0.0
    squared = 0.0
    for i in range(4):
        squared += quaternion[i] * quaternion[i]
    norm = math.sqrt(squared)
    return norm if 0.5 < norm < 2.0 else 0.0


class CycleArrays(NamedTuple):
    """What `fly_rates` uses. setpoint (4,): body rates [rad/s, FRD], thrust; commander (1,): its
    memory; numbers (1,): time [s] of the last cycle, NaN before the first; [s] without setpoints
    and thrust beyond which a cycle is another one; estimated thrust of hover, its parameter."""

    loop: RateLoop
    estimator: EstimatorArrays
    setpoint: np.ndarray
    commander: np.ndarray
    numbers: np.ndarray


@borrowing
def learn_hover(numbers: np.ndarray, force: np.ndarray, thrust: float, dt: float) -> None:
    """Estimate the thrust of hover from the present one and the mean specific force (3,) [m/s^2].

    numbers: of `CycleArrays`; dt [s]. A weak battery or a payload changes it. PX4 does so by a
    Kalman filter (MPC_USE_HTE).
    """
    m = numbers[0]
    lift = math.sqrt(force[0] ** 2 + force[1] ** 2 + force[2] ** 2)
    hover = thrust * GRAVITY / max(LEAST_LIFT, lift)
    m.hover += dt / HOVER_TIME * (hover - m.hover)
    m.hover = min(m.usual_hover + HOVER_RANGE, max(m.usual_hover - HOVER_RANGE, m.hover))


@borrowing
def fly_rates(a: CycleArrays, time: float, gyro: np.ndarray, accel: np.ndarray) -> bool:
    """Do what `Autopilot.update` does in flight with body rates; False, and nothing, if more is to
    be decided."""
    m, commander = a.numbers[0], a.commander[0]
    if time - commander.stream_last > m.loss_time or not a.setpoint[3] > m.low_thrust:
        return False
    dt = min(LONGEST_STEP, max(SHORTEST_STEP, time - m.time))
    m.time = commander.updated = time
    predict(gyro, accel, time, dt, a.estimator)
    learn_hover(a.numbers, a.estimator.mean_force, a.setpoint[3], dt)
    control_tick(gyro, dt, True, False, a.setpoint, a.loop)
    return True


@jit
def take_vision(
    time: float, position: np.ndarray, quaternion: np.ndarray, age: float, arrays: EstimatorArrays
) -> bool:
    """Handle an external pose; False: refused as not usable.

    position (3,) [m, NED]; quaternion (4,) [w x y z], FRD → NED; age [s]: `age_by` its arrival.
    """
    norm = magnitude_of_usable(position, quaternion)
    if norm == 0.0 or age == math.inf:
        return False
    fuse(position, quaternion / norm, time, age, arrays)
    return True
