"""Thrust factor, true thrust / thrust by the curve, identified in flight.

It corrects the thrust of a vehicle whose motors, propellers or battery differ from the parameters.
In steady flight Newton's law along the body's thrust axis gives

    measured = m (p_ddot + g e3) · R e3 / thrust of the command by the curve

from attitude and acceleration of /uam/state, the thrust sent, and the mass. The command first
passes a lag equal to that of motors and acceleration filter, so that numerator and denominator
belong to the same time. The factor follows `measured` as a first-order low pass with bounds and a
slew limit. The time constant is short at first, then equal to the time measured so far (a mean),
and finally long, so that the factor is much slower than the position law.

| condition | factor |
|---|---|
| on the ground, near it, tilted, accelerating, thrust near 0 or 1, values not finite | held |
| for `identification_settling` after any of these | held |
| magnet on (the mass of the payload is unknown) | held |
| magnet off, until `measured` is back at its earlier value: no payload hangs any more | held |
| `thrust_identification` freeze | held |
| `thrust_identification` off | returns to 1 |

A held factor is still applied. After a landing it is kept: battery and motors are the same.
"""

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from uam_control.coordinates import CHI, CHI_DDOT, PITCH, ROLL, YAW, X, Y, Z
from uam_control.laws.law_parameters import structured
from uam_control.maths.compiled import borrowing
from uam_control.settings.parameter_set import Bound, ParameterSet, choice, number
from uam_control.vehicle import VehicleDescription, derived_parameters, load_description

USABLE = (0.1, 0.9)  # normalised thrust: outside, the allocation reduces it in favour of torques
LONGEST_GAP = 0.1  # s between two ticks; after a longer gap the lag filter starts again
SETTLED = 3.0  # [times `identification_start`] of learning, after which a payload can be detected
# The magnet's state comes from another process. It counts only after this delay, at which it has
# arrived in every process: so a lockstep flight is reproducible.
MAGNET_DELAY = 0.01  # s
OFF, ON, FROZEN = 0.0, 1.0, 2.0  # the parameter thrust_identification as a number


@dataclass(frozen=True)
class ThrustIdentificationParameters(ParameterSet):
    """Conditions for a measurement of thrust, and time constants of the factor.

    The mass comes from the vehicle's description: `of`.
    """

    thrust_identification: str = choice(
        "on",
        "on: identify true thrust / assumed thrust in flight; freeze: hold it; off: 1",
        ("off", "on", "freeze"),
    )
    identification_mass: float = number(
        math.nan, "mass of the vehicle with its arm, without payload", "kg", 0.05, 500.0
    )
    identification_time: float = number(
        30.0,
        "time constant with which the factor follows the measurement in the long run",
        "s",
        0.5,
        3600.0,
    )
    identification_start: float = number(
        4.0, "the same at the beginning of the first flight", "s", 0.5, 600.0
    )
    identification_lag: float = number(
        0.05, "lag of motors and acceleration filter behind the thrust command", "s", 0.0, 0.5
    )
    identification_height: float = number(
        0.3, "height above the start from which on thrust is compared", "m", 0.05, 100.0
    )
    identification_tilt: float = number(
        0.15, "tilt up to which thrust is compared", "rad", 0.01, 1.0
    )
    identification_acceleration: float = number(
        1.0, "acceleration of the vehicle up to which thrust is compared", "m/s^2", 0.05, 20.0
    )
    identification_settling: float = number(
        0.5, "how long all that must have been so without a break", "s", 0.0, 60.0
    )
    identification_release: float = number(
        1.0,
        "wait after the magnet went off, before it is judged whether something hangs",
        "s",
        0.1,
        60.0,
    )
    hanging_mass: float = number(
        0.05,
        "payload from which on it counts as hanging after the magnet went off",
        "kg",
        1e-3,
        50.0,
    )
    factor_min: float = number(0.5, "smallest factor", "1", 0.2, 1.0)
    factor_max: float = number(1.3, "largest factor", "1", 1.0, 2.0)
    factor_slew: float = number(0.05, "largest change of the factor", "1/s", 1e-4, 1.0)

    @classmethod
    def of(cls, vehicle: VehicleDescription, values: Mapping[str, Any] | None = None) -> Self:
        """Return the validated set of a vehicle, with those of `values` that belong to the set."""
        return cls.among(derived_parameters(vehicle)["mavlink_bridge"] | dict(values or {}))

    def validated(self, axes: int = 0) -> Self:
        """See `ParameterSet.validated`; accepts YAML's `on` and `off`, read as true and false."""
        said = self.thrust_identification
        if isinstance(said, bool):
            return replace(self, thrust_identification="on" if said else "off").validated(axes)
        return super().validated(axes)


@borrowing
def steady_force(
    state: np.ndarray, tilt_max: float, acceleration_max: float, gravity: float
) -> float:
    """Return the specific force [m/s^2] along the thrust axis, 0 if the flight is not steady.

    state (3, 6 + n): see uam_control.coordinates; tilt_max [rad]; acceleration_max,
    gravity [m/s^2]. Returns 0 also if a value is not finite. The angles are checked first: math.cos
    of an infinite angle raises an error in plain Python, while compiled it is NaN.
    """
    ax, ay, az = state[CHI_DDOT, X], state[CHI_DDOT, Y], state[CHI_DDOT, Z]
    if not ax * ax + ay * ay + az * az <= acceleration_max * acceleration_max:
        return 0.0
    roll, pitch, yaw = state[CHI, ROLL], state[CHI, PITCH], state[CHI, YAW]
    if not (math.isfinite(roll) and math.isfinite(pitch) and math.isfinite(yaw)):
        return 0.0
    cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
    if not cp * cr >= math.cos(tilt_max):
        return 0.0
    cy, sy = math.cos(yaw), math.sin(yaw)
    force = ax * (cy * sp * cr + sy * sr) + ay * (sy * sp * cr - cy * sr) + (az + gravity) * cp * cr
    return force if force > 0.0 else 0.0


@borrowing
def identify(
    time: float,
    state: np.ndarray,
    command: float,
    assumed: float,
    flying: bool,
    record: np.ndarray,
    memory: np.ndarray,
) -> float:
    """Advance the identification by one tick and return the factor, always within its bounds.

    time [s]; state (3, 6 + n): see uam_control.coordinates; command: normalised thrust sent at this
    tick; assumed [N]: its collective by the curve, without the factor; flying: armed and
    controlled; record: numbers of the parameters, `numbers`; memory: state, `new_memory`; both
    structured arrays (1,).
    """
    p, m = record[0], memory[0]
    if not math.isfinite(time + assumed + command):
        return m.factor
    dt = time - m.time
    m.time = time
    if not 0.0 < dt <= LONGEST_GAP:  # the first tick, or ticks are missing
        m.assumed = assumed
        m.unsteady = time
        return m.factor
    m.assumed += (1.0 - math.exp(-dt / max(p.identification_lag, 1e-3))) * (assumed - m.assumed)
    if p.mode == OFF:
        m.learnt = 0.0
        move(1.0 - m.factor, dt, p, m)
        return m.factor
    height = state[CHI, Z]
    if not flying or math.isnan(m.ground):
        if math.isfinite(height):
            m.ground = height
        m.released = math.nan
        m.unsteady = time
    elif m.magnet == 0.0 and p.identification_height < height - m.ground < math.inf:
        compare(time, dt, state, command, p, m)
    return m.factor


@borrowing
def compare(
    time: float, dt: float, state: np.ndarray, command: float, p: np.record, m: np.record
) -> None:
    """Measure the factor in steady flight and follow the measurement; see `identify`."""
    force = steady_force(state, p.identification_tilt, p.identification_acceleration, p.gravity)
    if force == 0.0 or m.assumed <= 0.0 or not USABLE[0] <= command <= USABLE[1]:
        m.unsteady = time
    # A swaying vehicle is at rest for moments, and its motors saturate: rest must last.
    if time - m.unsteady <= p.identification_settling:
        return
    measured = p.identification_mass * force / m.assumed
    measured = min(p.factor_max, max(p.factor_min, measured))
    if not math.isnan(m.released) and hanging(time, dt, measured, p, m):
        return
    if p.mode == ON:
        m.learnt += dt
        span = min(p.identification_time, max(p.identification_start, m.learnt))
        gain = 1.0 - math.exp(-dt / span)
        move(gain * (measured - m.factor), dt, p, m)


@borrowing
def hanging(time: float, dt: float, measured: float, p: np.record, m: np.record) -> bool:
    """Whether a payload may still hang on the magnet that is off; see `identify`."""
    if math.isnan(m.recent):
        m.recent = measured
    m.recent += min(1.0, 2.0 * dt / p.identification_release) * (measured - m.recent)
    if time - m.released < p.identification_release:
        return True
    if math.isnan(m.before):  # the factor without payload is unknown: wait for the landing
        return True
    mass = p.identification_mass
    if m.recent < m.before * mass / (mass + p.hanging_mass):
        return True
    m.released = math.nan
    return False


@borrowing
def move(step: float, dt: float, p: np.record, m: np.record) -> None:
    """Change the factor by `step`, within slew limit and bounds; see `identify`."""
    limit = p.factor_slew * dt
    step = min(limit, max(-limit, step))
    m.factor = min(p.factor_max, max(p.factor_min, m.factor + step))


def numbers(parameters: ThrustIdentificationParameters, gravity: float) -> np.ndarray:
    """Return the structured array (1,) of the parameters that `identify` reads; gravity [m/s^2]."""
    specs = parameters.specs().items()
    values = {name: getattr(parameters, name) for name, one in specs if isinstance(one, Bound)}
    mode = (OFF, ON, FROZEN)[("off", "on", "freeze").index(parameters.thrust_identification)]
    return structured(values | {"mode": mode, "gravity": gravity})


def new_memory() -> np.ndarray:
    """Return the structured array (1,) of the state before the first tick.

    factor; time [s] of the last tick; assumed [N]: lagged as the motors; ground [m]: height of the
    vehicle on the ground; learnt [s]: of learning so far; unsteady [s]: last time at which the
    flight was not steady; magnet: 1 on; released [s]: magnet off, NaN once no payload hangs;
    recent: measurement since the release, fast low pass; before: settled factor before the magnet
    went on. NaN: unknown.
    """
    unknown = ("ground", "released", "recent", "before")
    values = {"factor": 1.0, "time": -math.inf, "assumed": 0.0, "learnt": 0.0, "magnet": 0.0}
    return structured(values | {"unsteady": -math.inf} | dict.fromkeys(unknown, math.nan))


class ThrustIdentification:
    """Estimate of the thrust factor, and the conditions under which it changes."""

    def __init__(
        self,
        parameters: ThrustIdentificationParameters | None = None,
        vehicle: VehicleDescription | None = None,
    ) -> None:
        """parameters: None for those of the vehicle; vehicle: None for the default one."""
        vehicle = vehicle or load_description()
        self._gravity = vehicle.gravity
        self.memory = new_memory()  # with `record` what the compiled `identify` reads and writes
        self._switches: deque[tuple[float, bool]] = deque()
        first = (parameters or ThrustIdentificationParameters.of(vehicle)).validated()
        self.record = numbers(first, self._gravity)
        self.configure(first)

    def configure(self, parameters: ThrustIdentificationParameters) -> None:
        """Apply new parameters; a ParameterError names the bad one and changes nothing."""
        p = self.parameters = parameters.validated()
        self.record[:] = numbers(p, self._gravity)
        memory = self.memory[0]
        memory.factor = min(p.factor_max, max(p.factor_min, memory.factor))

    @property
    def magnet_waits(self) -> bool:
        """Whether a state of the magnet does not count yet."""
        return bool(self._switches)

    def switch(self, time: float, on: bool) -> None:
        """Store the magnet's state at `time` [s]; it counts MAGNET_DELAY later."""
        if not math.isfinite(time):
            return
        if self._switches and time < self._switches[-1][0]:  # the clock was restarted
            self._switches.clear()
        self._switches.append((time, bool(on)))
        while len(self._switches) > 100:  # without ticks: keep the latest
            self._switches.popleft()

    def follow_magnet(self, time: float, usable: bool = True) -> None:
        """Take the magnet's states that count at the tick `time` [s], before `identify`.

        They wait for a tick without a gap before it; usable: whether its numbers are finite.
        """
        switches = self._switches
        if not switches or not usable:
            return
        m = self.memory[0]
        if not 0.0 < time - m.time <= LONGEST_GAP:
            return
        while switches and switches[0][0] <= time - MAGNET_DELAY:
            on = switches.popleft()[1]
            if on and not m.magnet:
                settled = m.learnt >= SETTLED * self.parameters.identification_start
                # if the last payload never came off, `before` keeps its value
                if math.isnan(m.released):
                    m.before = m.factor if settled else math.nan
            elif m.magnet and not on:
                m.released, m.recent = time, math.nan
            m.magnet = float(on)
