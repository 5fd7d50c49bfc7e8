"""Motors and servos: curves, lags and limits between command and force."""

from __future__ import annotations

import math

import numpy as np

from uam_control.maths.compiled import borrowing
from uam_control.vehicle import POSITION_SERVO

# Dynamixel XM430-W210, ROBOTIS e-manual: units of its control table
P_GAIN_SCALE = 128.0  # Position P Gain / 128 = PWM units per count
PWM_FULL = 885.0  # PWM units of the whole supply voltage
COUNTS_PER_TURN = 4096


class Rotors:
    """The rotors: motor command 0..1 → speed with lag → thrust.

    `speed` (rotors,) [rad/s], `thrust` (rotors,) [N].
    """

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
        self.speed = np.zeros(len(self.efficiency))
        self.thrust = np.zeros(len(self.efficiency))

    def scale_lags(self, factors: np.ndarray) -> None:
        """Multiply the time constants up and down (2, rotors) by factors of a shape like it."""
        self._lags *= factors
        self.gains[:] = [[1.0 - math.exp(-self._step / lag) for lag in row] for row in self._lags]

    def turn_linearly(self, idle: float) -> None:
        """Let the speed grow linearly with the command, from `idle` times the full speed on."""
        self.constants[2:] = idle**2, 2.0 * idle * (1.0 - idle), (1.0 - idle) ** 2

    def step(self, commands: np.ndarray, output: np.ndarray) -> None:
        """Advance one physics step with commands (rotors,) 0..1; write thrust [N] to output
        (rotors,)."""
        rotor_step(
            commands, self.constants, self.gains, self.efficiency, self.speed, self.thrust, output
        )


@borrowing
def rotor_step(
    commands: np.ndarray,
    constants: np.ndarray,
    gains: np.ndarray,
    efficiency: np.ndarray,
    speed: np.ndarray,
    thrust: np.ndarray,
    output: np.ndarray,
) -> None:
    """Advance rotors by one step: first-order speed lag, different up and down; T = c speed^2.

    commands u (rotors,) 0..1; constants (5,): thrust coefficient, full thrust [N], then a, b, c of
    T / full thrust = a + b u + c u^2; gains (2, rotors): share of the difference per step while
    speeding up and slowing down; efficiency (rotors,): factor on thrust; speed (rotors,) [rad/s],
    thrust and output (rotors,) [N] are overwritten.
    """
    coefficient, thrust_max, a, b, c = constants
    for i in range(len(commands)):
        u = min(max(commands[i], 0.0), 1.0)
        desired = math.sqrt(thrust_max * (c * u * u + b * u + a) / coefficient)
        gain = gains[0, i] if desired > speed[i] else gains[1, i]
        speed[i] += gain * (desired - speed[i])
        thrust[i] = efficiency[i] * coefficient * speed[i] * speed[i]
        output[i] = thrust[i]


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
        self.loop = np.array(
            [
                numbers["position_p_gain"] / P_GAIN_SCALE / PWM_FULL,
                numbers["pwm_limit"] / PWM_FULL,
                2.0 * np.pi / COUNTS_PER_TURN,
                float(self.in_position_mode),
            ]
        )
        unit = np.multiply(numbers["torque_per_current"], numbers["current_unit"])
        constants = numbers["stall_torque"], numbers["no_load_speed"], unit
        self.constants = np.array([one + np.zeros(len(start)) for one in map(np.array, constants)])
        self.torque = np.zeros(len(start))
        self.waiting = np.full((numbers["command_latency_ticks"], len(start)), np.nan)

    def take(self, command: np.ndarray, tick: int = 0) -> None:
        """Send `command` (n,) at the control tick `tick`; see `receive`."""
        receive(command, tick, self.waiting, self.command)

    def step(self, angle: np.ndarray, velocity: np.ndarray, output: np.ndarray) -> None:
        """Write the torque (n,) [N m] at angle (n,) [rad] and velocity (n,) [rad/s] to output."""
        joint_step(self.command, angle, velocity, self.constants, self.loop, self.torque, output)


@borrowing
def receive(sent: np.ndarray, tick: int, waiting: np.ndarray, held: np.ndarray) -> None:
    """Send a command on the bus; the one that arrives at this tick is written to `held` (n,).

    sent (n,): NaN for no command, as at the begin: `held` stays; waiting (latency, n): those on
    their way, exchanged in turns, one at each control tick.
    """
    latency = len(waiting)
    for i in range(len(held)):
        value = sent[i]
        if latency:
            value, waiting[tick % latency, i] = waiting[tick % latency, i], value
        if math.isfinite(value):
            held[i] = value


@borrowing
def joint_step(
    command: np.ndarray,
    angle: np.ndarray,
    velocity: np.ndarray,
    constants: np.ndarray,
    loop: np.ndarray,
    torque: np.ndarray,
    output: np.ndarray,
) -> None:
    """Write torque and output (n,) [N m] in the mode of the servos.

    command (n,): see `Servos`; angle (n,) [rad]; velocity (n,) [rad/s]; constants: see
    `servo_step`; loop (4,): duty per count of position error, largest duty, count [rad], whether
    the servos are in position control.
    """
    if loop[3] > 0.0:
        position_step(command, angle, velocity, constants, loop, torque, output)
    else:
        servo_step(command, velocity, constants, torque, output)


@borrowing
def position_step(
    goal: np.ndarray,
    angle: np.ndarray,
    velocity: np.ndarray,
    constants: np.ndarray,
    loop: np.ndarray,
    torque: np.ndarray,
    output: np.ndarray,
) -> None:
    """Write torque and output (n,) [N m] of the position loop; arguments as in `joint_step`.

    duty = gain (goal - angle) in whole counts, limited; torque = stall (duty - speed / no-load
    speed), the line of a DC motor at the voltage of the duty. Source: ROBOTIS e-manual, XM430-W210,
    Position PID Gain. The maker's I and D gains are 0.
    """
    gain, limit, count = loop[0], loop[1], loop[2]
    for i in range(len(goal)):
        stall, no_load = constants[0, i], constants[1, i]
        error = np.round(goal[i] / count) - np.round(angle[i] / count)
        duty = min(limit, max(-limit, gain * error))
        torque[i] = min(stall, max(-stall, stall * (duty - velocity[i] / no_load)))
        output[i] = torque[i]


@borrowing
def servo_step(
    effort: np.ndarray,
    velocity: np.ndarray,
    constants: np.ndarray,
    torque: np.ndarray,
    output: np.ndarray,
) -> None:
    """Write torque and output (n,) [N m]: effort in whole current units, within the speed limit.

    effort (n,) [N m]; velocity (n,) [rad/s]; constants (3, n): stall torque [N m], no-load
    speed [rad/s], torque of one current unit [N m]. Limit: stall torque (1 - speed / no-load
    speed).
    """
    for i in range(len(effort)):
        stall, no_load, unit = constants[0, i], constants[1, i], constants[2, i]
        desired = unit * np.round(effort[i] / unit)
        forward = max(0.0, min(1.0, 1.0 - velocity[i] / no_load)) * stall
        backward = max(0.0, min(1.0, 1.0 + velocity[i] / no_load)) * stall
        torque[i] = min(max(desired, -backward), forward)
        output[i] = torque[i]
