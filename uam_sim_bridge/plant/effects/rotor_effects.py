"""Effects of rotors and battery: vibration in the IMU, spread, sag, fade, thrust near the ground.

Vibration. An unbalanced rotor pushes the frame with m e omega^2, turning in the rotor's plane
(first harmonic). The blades make the thrust vary at the blade-passing frequency, twice the rotor
speed for two blades. Each force accelerates the frame as a rigid body, by F / m and r x F / I;
resonances of the frame multiply both by `frame_gain`. An IMU sample is the mean over the control
period, as PX4 integrates its IMU (IMU_INTEG_RATE): the harmonics above half the sample rate do not
alias back.

Battery. Rest voltage of a cell falls linearly from `full` to `empty` with the charge taken; the
current times the resistance is lost on top. The rotors' speed at a command is proportional to the
voltage, so their thrust to its square; the nominal thrust holds at the voltage `full` without load.
Power: P = sum(T^1.5) / sqrt(2 rho A) / figure of merit (momentum theory), plus the electronics.

Ground effect. Method of images for the rotors of a multirotor, with the fountain between them
(Sanchez-Cuevas, Heredia, Ollero 2017, eq. (8)):

    T/T_inf = 1 / (1 - (R/4z)^2 - R^2 z / (d^2 + 4z^2)^1.5 - (R^2/2) z / (2d^2 + 4z^2)^1.5
                   - 2 R^2 K z / (b^2 + 4z^2)^1.5)

z: height of the rotor above the floor, R: its radius, d: distance to the next rotor, b: to the
opposite one, K: strength of the fountain. The formula is for four rotors; other vehicles use their
own d and b. Stand and mat count as floor at height 0.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from uam_control.maths.compiled import borrowing
from uam_control.maths.memory import record
from uam_sim_bridge.plant.effects.effect import AIR, Acting, Bench, Compiled, Effect, each, size
from uam_sim_bridge.plant.vehicle import BASE

BLADES = 2


class PropellerVibration(Effect):
    """Unbalanced propellers and blade passing shake the IMU through the frame."""

    SOURCE = (
        "rigid-body mechanics; imbalance as ISO 21940 grade G 16 of 50 g; frame_gain so that the "
        "accelerometer shows about 1 m/s^2 RMS after PX4's integration"
    )

    imbalance: float = size("mean static imbalance of a rotor", "kg m", 0.0, 1e-3)
    blade_passing: float = size("amplitude at twice the rotor speed / thrust", "1", 0.0, 0.5)
    frame_gain: float = size("resonance of the frame, factor on both", "1", 0.0, 50.0)

    def begin(self, bench: Bench, noise: np.random.Generator) -> Acting:
        rotors, model = len(bench.positions), bench.model
        spread = self.imbalance * np.abs(1.0 + 0.3 * noise.standard_normal(rotors))
        phases, base = noise.uniform(0.0, 2.0 * math.pi, rotors), model.body(BASE).id
        arrays = Shaken(
            *(bench.sample, bench.rotors.speed, bench.directions, bench.positions),
            *(phases, spread),
            self.blade_passing * bench.vehicle.description.rotor.thrust_coefficient,
            self.frame_gain / float(model.body_subtreemass[base]),
            self.frame_gain / model.body_inertia[base],
            bench.period,
        )
        return Compiled(arrays, sample=vibrate)


class Shaken(NamedTuple):
    """Rotors and frame."""

    sample: np.ndarray  # see `Bench`
    speed: np.ndarray  # (rotors,) [rad/s]
    directions: np.ndarray  # (rotors,) 1 counter-clockwise
    positions: np.ndarray  # (rotors, 3) [m, FLU]
    phases: np.ndarray  # (rotors,) [rad] their state
    imbalance: np.ndarray  # (rotors,) [kg m]
    blade: float  # [N s^2/rad^2] amplitude of the thrust / speed^2
    mass: float  # [1/kg] frame gain / mass
    inertia: np.ndarray  # (3,) [1/(kg m^2)] frame gain / inertia
    period: float  # [s] of a sample


@borrowing
def mean_of_wave(phase: float, angle: float) -> tuple[float, float]:
    """Return the means of cos and sin over the phases from `phase` to `phase + angle` [rad]."""
    if abs(angle) < 1e-6:
        return math.cos(phase), math.sin(phase)
    end = phase + angle
    cosine = (math.sin(end) - math.sin(phase)) / angle
    return cosine, (math.cos(phase) - math.cos(end)) / angle


@borrowing
def vibrate(a: Shaken) -> int:
    """Add the vibration to gyro and specific force; the phases advance by one period."""
    sample, inertia = a.sample, a.inertia
    for i in range(len(a.speed)):
        omega = a.speed[i]
        if omega < 1.0:
            continue
        angle = omega * a.period
        x, y, z = a.positions[i, 0], a.positions[i, 1], a.positions[i, 2]
        cosine, sine = mean_of_wave(a.phases[i], angle)
        across = a.imbalance[i] * omega * omega
        fx, fy = across * cosine, across * a.directions[i] * sine
        cosine2, sine2 = mean_of_wave(BLADES * a.phases[i], BLADES * angle)
        up = a.blade * omega * omega
        sample[3] += a.mass * fx
        sample[4] += a.mass * fy
        sample[5] += a.mass * up * cosine2
        # body rates are the integrals of torque / inertia: divided by the frequency, 90 deg behind
        gx, gy = across * sine / omega, -across * a.directions[i] * cosine / omega
        gz = up * sine2 / (BLADES * omega)
        sample[0] += inertia[0] * (y * gz - z * gy)
        sample[1] += inertia[1] * (z * gx - x * gz)
        sample[2] += inertia[2] * (x * gy - y * gx)
        a.phases[i] = (a.phases[i] + angle) % (2.0 * math.pi)
    return 0


class RotorMismatch(Effect):
    """Thrust, reaction torque, lags and idle speed of the rotors are not the vehicle file's."""

    SOURCE = (
        "six flights and a thrust stand of the T650, FSC-Lab: thrust 0.946 to 1.011 of what its "
        "allocator believes, reaction torque / thrust 0.76 of it [fit, wb 1.1-1.6]"
    )

    thrust: tuple[float, ...] = each(
        "thrust / the vehicle file's, for each rotor or for all", "1", 0.5, 1.5
    )
    yaw: float = size("reaction torque per thrust / the vehicle file's", "1", 0.0, 3.0)
    lag_up: float = size("time constant while speeding up / the vehicle file's", "1", 0.1, 10.0)
    lag_down: float = size("the same while slowing down", "1", 0.1, 10.0)
    idle: float = size(
        "speed at command 0 / full speed, linear between; 0: the vehicle file's curve",
        "1",
        0.0,
        0.5,
    )

    def begin(self, bench: Bench, noise: np.random.Generator) -> None:
        rotors, count = bench.rotors, len(bench.rotors.speed)
        rotors.efficiency *= bench.for_each("rotor_mismatch: thrust", self.thrust, count, "rotors")
        rotors.scale_lags(np.array([[self.lag_up], [self.lag_down]]))
        if self.idle > 0.0:
            rotors.turn_linearly(self.idle)
        for name in bench.vehicle.description.rotor_names:
            bench.model.actuator(name).gear[5] *= self.yaw


LIMIT = 2.5  # [1] a draw is at most so many standard deviations away: worse parts are exchanged


class RotorSpread(Effect):
    """Rotors differ in thrust at the same command, motors and ESCs in their time constants."""

    SOURCE = (
        "thrust: 10-inch propellers and 5010 motors of one batch on a thrust stand differ by some "
        "per cent (assumption, 3 %); lag: assumption, 10 %"
    )

    thrust: float = size("standard deviation of the thrust factor", "1", 0.0, 0.2)
    lag: float = size("standard deviation of the factor on the time constants", "1", 0.0, 0.3)

    def begin(self, bench: Bench, noise: np.random.Generator) -> None:
        rotors = bench.rotors
        drawn = np.clip(noise.standard_normal((2, len(rotors.speed))), -LIMIT, LIMIT)
        rotors.efficiency *= 1.0 + self.thrust * drawn[0]
        rotors.scale_lags(1.0 + self.lag * drawn[1])


SMOOTHING = 0.1  # [s] of the current: the voltage follows the load after capacitors and ESCs


class BatterySag(Effect):
    """The battery's voltage falls with charge and current, and with it the thrust."""

    SOURCE = (
        "PX4 v1.16: BAT1_V_CHARGED 4.05 V, BAT1_V_EMPTY 3.6 V, 5 mOhm per cell as typical in its "
        "guide to battery estimation; 4S 5000 mAh of the S-500 class; figure of merit 0.6: Bangura "
        "et al. 2016"
    )

    cells: float = size("cells in series", "1", 1.0, 14.0)
    capacity: float = size("charge from full to empty", "A h", 0.1, 100.0)
    full: float = size("rest voltage of a full cell", "V", 3.0, 4.5)
    empty: float = size("rest voltage of an empty cell", "V", 2.5, 4.2)
    resistance: float = size("of a cell with its share of cables", "Ohm", 0.0, 0.1)
    figure_of_merit: float = size("ideal / electrical power of a rotor", "1", 0.1, 1.0)
    electronics: float = size("power of computer, servos and magnet", "W", 0.0, 200.0)
    start: float = size("state of charge at the start, the least", "1", 0.1, 1.0)

    def begin(self, bench: Bench, noise: np.random.Generator) -> Acting:
        charge, area = (
            noise.uniform(self.start, 1.0),
            math.pi * bench.vehicle.description.rotor.radius**2,
        )
        names = "charge current cells full empty_cell resistance electronics capacity"
        numbers = record("", f"{names} nominal per_thrust gain period")
        numbers[0] = (
            *(charge, 0.0, self.cells, self.full, self.empty),
            *(self.resistance, self.electronics, self.capacity),
            bench.rotors.constants[1],
            1.0 / (self.figure_of_merit * math.sqrt(2.0 * AIR * area)),
            *(1.0 - math.exp(-bench.period / SMOOTHING), bench.period),
        )
        arrays = bench.rotors.thrust, bench.rotors.constants, numbers
        return Compiled(arrays, tick=discharge)


@borrowing
def discharge(a: tuple) -> int:
    """Take the charge of a control period; set the full thrust to that at the voltage.

    thrusts (rotors,) [N]; constants: of `rotor_step`; numbers (1,): state of charge, current [A],
    nominal: full thrust [N] at the voltage `full`, per_thrust: electrical power [W] / sum(T^1.5),
    gain: of the current's low-pass, period [s]; the others as in `BatterySag`.
    """
    thrusts, constants, numbers = a
    m, ideal = numbers[0], 0.0
    rest = m.cells * (m.empty_cell + (m.full - m.empty_cell) * m.charge)
    for thrust in thrusts:
        ideal += thrust**1.5
    voltage = rest - m.cells * m.resistance * m.current
    m.current += m.gain * ((m.per_thrust * ideal + m.electronics) / voltage - m.current)
    m.charge = max(0.0, m.charge - m.current * m.period / (3600.0 * m.capacity))
    constants[1] = m.nominal * (voltage / (m.cells * m.full)) ** 2
    return 0


LEAST = 0.3  # [1] part of the thrust that is left at the end


class ThrustFade(Effect):
    """The thrust at the same command falls with the time since lift-off."""

    SOURCE = "six flights of the T650, FSC-Lab: 2.6 to 4.5 % a minute, 3.6 % in its plant [wb 1.1]"

    per_minute: float = size("part of the thrust that is lost in a minute", "1/min", 0.0, 0.5)

    def begin(self, bench: Bench, noise: np.random.Generator) -> Acting:
        described = bench.vehicle.description
        weight, loss = described.mass * described.gravity, self.per_minute / 60.0 * bench.period
        arrays = bench.rotors.thrust, bench.lift, np.ones(1), weight, loss
        return Compiled(arrays, tick=fade)


@borrowing
def fade(a: tuple) -> int:
    """Take the loss of a tick from the thrust, from lift-off on.

    thrusts (rotors,) [N], lift (rotors,): see `Bench`; part (1,): of the thrust that is left;
    weight [N]: from which thrust on it falls.
    """
    thrusts, lift, part, weight, loss = a
    total = 0.0
    for thrust in thrusts:
        total += thrust
    if part[0] < 1.0 or total > weight:
        part[0] = max(LEAST, part[0] - loss)
    for i in range(len(lift)):
        lift[i] *= part[0]
    return 0


LOWEST = 0.5  # [1] of the radius: the formula is not valid below


class GroundEffect(Effect):
    """Rotors near the floor make more thrust at the same speed."""

    SOURCE = (
        "Sanchez-Cuevas, Heredia, Ollero 2017, doi 10.1155/2017/1823056: images of four rotors, "
        "fountain K = 2; single rotor: Cheeseman and Bennett 1955"
    )

    strength: float = size("factor on the gain of thrust", "1", 0.0, 3.0)
    fountain: float = size("K, strength of the fountain between the rotors", "1", 0.0, 5.0)

    def begin(self, bench: Bench, noise: np.random.Generator) -> Acting:
        positions = bench.positions
        apart = np.linalg.norm(positions[:, None, :2] - positions[None, :, :2], axis=2)
        radius = bench.vehicle.description.rotor.radius
        near = float(np.where(apart > 0.0, apart, np.inf).min())
        shape = np.array([radius, near, float(apart.max()), self.fountain, self.strength])
        arrays = bench.base_position, bench.base_axes, positions, shape, bench.lift
        return Compiled(arrays, tick=lift)


@borrowing
def thrust_ratio(height: float, shape: np.ndarray) -> float:
    """Return thrust / thrust far from the floor at `height` [m] of the rotor above the floor.

    shape (5,): R, d, b [m], K, strength of `GroundEffect`.
    """
    radius, near, opposite, fountain, strength = shape
    z = max(height, LOWEST * radius)
    r2, four = radius * radius, 4.0 * z * z
    loss = (radius / (4.0 * z)) ** 2
    loss += r2 * z / (near * near + four) ** 1.5
    loss += 0.5 * r2 * z / (2.0 * near * near + four) ** 1.5
    loss += 2.0 * r2 * fountain * z / (opposite * opposite + four) ** 1.5
    return 1.0 + strength * (1.0 / (1.0 - loss) - 1.0)


@borrowing
def raise_thrust(
    base: np.ndarray, axes: np.ndarray, positions: np.ndarray, shape: np.ndarray, lift: np.ndarray
) -> None:
    """Multiply lift (rotors,) by the ratio of each rotor at its own height.

    base (3,) [m, ENU]; axes (9,): body → world, row by row; positions (rotors, 3) [m, FLU]; shape:
    see `thrust_ratio`.
    """
    for i in range(len(lift)):
        height = base[2]
        for k in range(3):
            height += axes[6 + k] * positions[i, k]
        lift[i] *= thrust_ratio(height, shape)


@borrowing
def lift(a: tuple) -> int:
    """Do `raise_thrust` with the arguments `a`."""
    raise_thrust(a[0], a[1], a[2], a[3], a[4])
    return 0
