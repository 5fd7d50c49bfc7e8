"""Motors and servos: curves, lags and limits between command and force."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from uam_control.maths.compiled import borrowing
from uam_control.vehicle import POSITION_SERVO

# Dynamixel XM430-W210, ROBOTIS e-manual: units of its control table
P_GAIN_SCALE = 128.0  # Position P Gain / 128 = PWM units per count
PWM_FULL = 885.0  # PWM units of the whole supply voltage
COUNTS_PER_TURN = 4096


class RotorArrays(NamedTuple):
    """Rotors. constants: thrust coefficient, full thrust [N], then a, b, c of T / full thrust = a +
    b u + c u^2."""

    constants: np.ndarray  # (5,)
    gains: np.ndarray  # (2, rotors) part of the difference per step, speeding up and slowing down
    efficiency: np.ndarray  # (rotors,) factor on thrust
    speed: np.ndarray  # (rotors,) [rad/s] state
    thrust: np.ndarray  # (rotors,) [N] state


class Rotors:
    """The rotors: motor command 0..1 → speed with lag → thrust; their arrays: see `RotorArrays`."""

    def __init__(self, numbers: dict, step: float) -> None:
        """numbers: the `rotors` entry of the vehicle; step: physics step [s]."""
        self.efficiency = np.array(numbers["efficiency"], dtype=float)
        full, factor = numbers["thrust_coefficient"], numbers["curve_factor"]
        full *= numbers["speed_max"] ** 2
        self.constants = np.array([numbers["thrust_coefficient"], full, 0.0, 1.0 - factor, factor])
        lags = [[numbers["lag_up"]], [numbers["lag_down"]]]
        self._lags, self._step = np.repeat(lags, len(self.efficiency), axis=1), step
        self.gains = np.empty_like(self._lags)
        self.scale_lags(np.ones(len(self.efficiency)))
        self.speed, self.thrust = np.zeros((2, len(self.efficiency)))
        given = self.constants, self.gains, self.efficiency
        self.arrays = RotorArrays(*given, self.speed, self.thrust)

    def scale_lags(self, factors: np.ndarray) -> None:
        """Multiply the time constants up and down (2, rotors) by factors of a shape like it."""
        self._lags *= factors
        self.gains[:] = [[1.0 - math.exp(-self._step / lag) for lag in row] for row in self._lags]

    def turn_linearly(self, idle: float) -> None:
        """Let the speed grow linearly with the command, from `idle` times the full speed on."""
        self.constants[2:] = idle**2, 2.0 * idle * (1.0 - idle), (1.0 - idle) ** 2


@borrowing
def rotor_step(commands: np.ndarray, a: RotorArrays, output: np.ndarray) -> None:
    """Advance rotors by one step: first-order speed lag, different up and down; T = c speed^2.

    commands u (rotors,) 0..1; output (rotors,) [N]: gets the thrust, too.
    """
    coefficient, thrust_max, p, q, r = a.constants
    for i in range(len(commands)):
        u = min(max(commands[i], 0.0), 1.0)
        desired = math.sqrt(thrust_max * (r * u * u + q * u + p) / coefficient)
        gain = a.gains[0, i] if desired > a.speed[i] else a.gains[1, i]
        a.speed[i] += gain * (desired - a.speed[i])
        a.thrust[i] = a.efficiency[i] * coefficient * a.speed[i] * a.speed[i]
        output[i] = a.thrust[i]


class ServoArrays(NamedTuple):
    """Joints. constants: stall torque [N m], no-load speed [rad/s], torque of one current unit
    [N m]; loop: duty per count of position error, largest duty, count [rad], whether the servos are
    in position control."""

    command: np.ndarray  # (n,) see `Servos`
    constants: np.ndarray  # (3, n)
    loop: np.ndarray  # (4,)
    torque: np.ndarray  # (n,) [N m]
    waiting: np.ndarray  # (latency, n) commands on their way, exchanged in turns, one at each tick


class Servos:
    """Dynamixel XM430-W210 in current or position control, `servos.mode` of the vehicle.

    `torque` (n,) [N m]: of the gear before friction. The MJCF has friction and reflected inertia.
    `command` (n,): effort [N m], or goal positions [rad]. A servo in position control holds its
    initial angle until the first goal.
    """

    def __init__(self, numbers: dict, start: np.ndarray) -> None:
        """numbers: the `servos` entry of the vehicle; start (n,): initial joint angles [rad]."""
        self.in_position_mode = numbers["mode"] == POSITION_SERVO
        self.command = np.array(start if self.in_position_mode else np.zeros(len(start)))
        loop = np.array(
            [
                numbers["position_p_gain"] / P_GAIN_SCALE / PWM_FULL,
                numbers["pwm_limit"] / PWM_FULL,
                2.0 * np.pi / COUNTS_PER_TURN,
                float(self.in_position_mode),
            ]
        )
        unit = np.multiply(numbers["torque_per_current"], numbers["current_unit"])
        given = numbers["stall_torque"], numbers["no_load_speed"], unit
        constants = np.array([one + np.zeros(len(start)) for one in map(np.array, given)])
        self.torque = np.zeros(len(start))
        waiting = np.full((numbers["command_latency_ticks"], len(start)), np.nan)
        self.arrays = ServoArrays(self.command, constants, loop, self.torque, waiting)


@borrowing
def receive(sent: np.ndarray, tick: int, a: ServoArrays) -> None:
    """Send a command on the bus; the one that arrives at this tick is held from now on.

    sent (n,): NaN for no command, as at the begin: the held one stays.
    """
    latency = len(a.waiting)
    for i in range(len(a.command)):
        value = sent[i]
        if latency:
            value, a.waiting[tick % latency, i] = a.waiting[tick % latency, i], value
        if math.isfinite(value):
            a.command[i] = value


@borrowing
def joint_step(a: ServoArrays, angle: np.ndarray, velocity: np.ndarray, output: np.ndarray) -> None:
    """Write torque and output (n,) [N m] in the servos' mode; angle, velocity (n,) [rad, rad/s]."""
    if a.loop[3] > 0.0:
        position_step(a, angle, velocity, output)
    else:
        servo_step(a, velocity, output)


@borrowing
def position_step(
    a: ServoArrays, angle: np.ndarray, velocity: np.ndarray, output: np.ndarray
) -> None:
    """Write torque and output (n,) [N m] of the position loop; arguments as in `joint_step`.

    duty = gain (goal - angle) in whole counts, limited; torque = stall (duty - speed / no-load
    speed), the line of a DC motor at the voltage of the duty. Source: ROBOTIS e-manual, XM430-W210,
    Position PID Gain. The maker's I and D gains are 0.
    """
    gain, limit, count = a.loop[0], a.loop[1], a.loop[2]
    for i in range(len(a.command)):
        stall, no_load = a.constants[0, i], a.constants[1, i]
        error = np.round(a.command[i] / count) - np.round(angle[i] / count)
        duty = min(limit, max(-limit, gain * error))
        a.torque[i] = min(stall, max(-stall, stall * (duty - velocity[i] / no_load)))
        output[i] = a.torque[i]


@borrowing
def servo_step(a: ServoArrays, velocity: np.ndarray, output: np.ndarray) -> None:
    """Write torque and output (n,) [N m]: effort in whole current units, within the speed limit.

    velocity (n,) [rad/s]. Limit: stall torque (1 - speed / no-load speed).
    """
    for i in range(len(a.command)):
        stall, no_load, unit = a.constants[0, i], a.constants[1, i], a.constants[2, i]
        desired = unit * np.round(a.command[i] / unit)
        forward = max(0.0, min(1.0, 1.0 - velocity[i] / no_load)) * stall
        backward = max(0.0, min(1.0, 1.0 + velocity[i] / no_load)) * stall
        a.torque[i] = min(max(desired, -backward), forward)
        output[i] = a.torque[i]
