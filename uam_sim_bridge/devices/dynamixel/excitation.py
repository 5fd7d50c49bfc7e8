"""Motion that excites one joint through the driver, the others held, with criteria to abort."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from uam_control.settings.parameter_set import ParameterSet, number
from uam_sim_bridge.devices.dynamixel.driver import ArmDriver, Reading

# two sines without a common period of a few seconds: angle, velocity and acceleration are then
# uncorrelated; (share of the amplitude, factor of the frequency)
SINES = ((0.65, 1.0), (0.35, 2.7))


class Aborted(RuntimeError):
    """The experiment ended early; the text is one line. Torque is off."""


@dataclass(frozen=True)
class ExcitationParameters(ParameterSet):
    """The motion, the loop that follows it, and the limits at which it ends."""

    amplitude_deg: float = number(40.0, "largest angle to either side", "deg", 5.0, 90.0)
    frequency: float = number(0.25, "of the slower sine", "Hz", 0.05, 1.0)
    duration: float = number(20.0, "of the excitation", "s", 5.0, 300.0)
    approach: float = number(3.0, "time to the centre, and back", "s", 1.0, 30.0)
    stiffness: float = number(3.0, "of the loop that follows the motion", "N m/rad", 0.1, 50.0)
    damping: float = number(0.15, "of that loop", "N m s/rad", 0.0, 5.0)
    effort_max: float = number(1.5, "largest effort", "N m", 0.05, 10.0)
    error_max: float = number(0.5, "distance from the motion that aborts", "rad", 0.05, 2.0)
    speed_max: float = number(4.0, "joint speed that aborts", "rad/s", 0.2, 20.0)
    temperature_max: float = number(60.0, "servo temperature that aborts", "deg C", 30.0, 90.0)
    margin_deg: float = number(5.0, "distance that the motion keeps from a limit", "deg", 1.0, 45.0)


@dataclass(frozen=True)
class Record:
    """Samples of the excitation: times (m,) [s], angles, velocities, motor torques (m, n)."""

    times: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    effort: np.ndarray


class Excitation:
    """Angle and velocity of the excited joint over time, from its start and back to it."""

    def __init__(self, start: float, centre: float, parameters: ExcitationParameters) -> None:
        """start, centre [rad]."""
        self._start, self._centre, self._p = start, centre, parameters
        self.begin, self.end = parameters.approach, parameters.approach + parameters.duration
        self.total = self.end + parameters.approach  # [s]

    def at(self, time: float) -> tuple[float, float]:
        """Return the desired angle [rad] and velocity [rad/s] at `time` [s]."""
        if time < self.begin:
            return self._moved(self._start, self._centre, time)
        if time < self.end:
            return self._excited(time - self.begin)
        last = self._excited(self._p.duration)[0]
        return self._moved(last, self._start, time - self.end)

    def _excited(self, time: float) -> tuple[float, float]:
        """Sum of sines, faded in and out within one second."""
        amplitude = math.radians(self._p.amplitude_deg)
        value = rate = 0.0
        for share, factor in SINES:
            omega = 2.0 * math.pi * self._p.frequency * factor
            value += share * amplitude * math.sin(omega * time)
            rate += share * amplitude * omega * math.cos(omega * time)
        fade, slope = _smooth_step(time)
        out, fall = _smooth_step(self._p.duration - time)
        window, change = fade * out, slope * out - fade * fall
        return self._centre + window * value, window * rate + change * value

    def _moved(self, first: float, last: float, time: float) -> tuple[float, float]:
        share, rate = _smooth_step(time / self._p.approach)
        return first + share * (last - first), rate * (last - first) / self._p.approach


def _smooth_step(share: float) -> tuple[float, float]:
    """Return the quintic step 0 → 1 and its slope."""
    s = min(max(share, 0.0), 1.0)
    return s**3 * (10.0 - 15.0 * s + 6.0 * s * s), 30.0 * s * s * (1.0 - s) ** 2


def centre_of(driver: ArmDriver, joint: int, start: float, p: ExcitationParameters) -> float:
    """Return the centre [rad] nearest to `start` at which the motion fits the joint's range.

    Raises Aborted if there is none.
    """
    servo, reach = driver.chain.arm[joint], math.radians(p.amplitude_deg + p.margin_deg)
    low, high = servo.low + reach, servo.high - reach
    if low > high:
        widest = math.degrees(0.5 * (servo.high - servo.low)) - p.margin_deg
        raise Aborted(
            f"amplitude_deg {p.amplitude_deg:g} does not fit the range of {servo.label}; at most "
            f"{widest:.0f}"
        )
    return min(max(start, low), high)


def excite(
    driver: ArmDriver,
    joint: int,
    centre: float,
    weight: Callable[[float], np.ndarray],
    parameters: ExcitationParameters,
    pace: Callable[[], float],
) -> Record:
    """Move one joint of a started driver, and return the samples of the excitation.

    centre [rad]; weight: angle [rad] of the joint → holding torques (n,) [N m] of the arm; pace:
    waits until the next cycle and returns the time [s]. Raises Aborted; the driver is stopped
    then, and otherwise left running.
    """
    p = parameters
    try:
        first = _first_reading(driver, pace)
        hold, motion = first.position.copy(), Excitation(first.position[joint], centre, p)
        rows, reading, desired_rate = [], first, np.zeros(len(hold))
        started = pace()
        while (time := pace() - started) < motion.total:
            desired = hold.copy()
            desired[joint], desired_rate[joint] = motion.at(time)
            error = desired - reading.position
            effort = weight(reading.position[joint]) + p.stiffness * error
            effort += p.damping * (desired_rate - reading.velocity)
            driver.command_effort(np.clip(effort, -p.effort_max, p.effort_max))
            reading = driver.cycle() or reading
            _check(driver, reading, error, p)
            if motion.begin <= time < motion.end and (not rows or reading is not rows[-1]):
                rows.append(reading)
        return Record(
            np.array([row.time for row in rows]),
            np.array([row.position for row in rows]),
            np.array([row.velocity for row in rows]),
            np.array([row.effort for row in rows]),
        )
    except BaseException:
        driver.stop()
        raise


def _first_reading(driver: ArmDriver, pace: Callable[[], float]) -> Reading:
    for _ in range(100):
        if (reading := driver.cycle()) is not None:
            return reading
        pace()
    raise Aborted("; ".join(driver.problems) or "the servos do not answer")


def _check(driver: ArmDriver, reading: Reading, error: np.ndarray, p: ExcitationParameters) -> None:
    """Raise Aborted if a limit is exceeded."""
    if problems := driver.problems:
        raise Aborted("; ".join(problems))
    for i, servo in enumerate(driver.chain.arm):
        angle, speed = reading.position[i], reading.velocity[i]
        heat = driver.health[i].temperature
        if not servo.low <= angle <= servo.high:
            raise Aborted(f"{servo.label}: {math.degrees(angle):.0f} deg is beyond its limit")
        if abs(error[i]) > p.error_max:
            raise Aborted(
                f"{servo.label}: {error[i]:.2f} rad from the motion, {p.error_max:g} allowed: "
                "blocked, too heavy, or a wrong direction?"
            )
        if abs(speed) > p.speed_max:
            raise Aborted(f"{servo.label}: {speed:.1f} rad/s, {p.speed_max:g} allowed")
        if heat > p.temperature_max:
            raise Aborted(f"{servo.label}: {heat:.0f} deg C, {p.temperature_max:g} allowed")
