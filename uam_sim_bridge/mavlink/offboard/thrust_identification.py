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

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from uam_control.coordinates import CHI, CHI_DDOT, PITCH, ROLL, YAW, X, Y, Z
from uam_control.maths.compiled import jit, prepared
from uam_control.settings.parameter_set import ParameterSet, choice, number
from uam_control.vehicle import VehicleDescription, derived_parameters, load_description

USABLE = (0.1, 0.9)  # normalised thrust: outside, the allocation reduces it in favour of torques
LONGEST_GAP = 0.1  # s between two ticks; after a longer gap the lag filter starts again
SETTLED = 3.0  # [times `identification_start`] of learning, after which a payload can be detected
# The magnet's state comes from another process. It counts only after this delay, at which it has
# arrived in every process: so a lockstep flight is reproducible.
MAGNET_DELAY = 0.01  # s


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


@jit
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


class ThrustIdentification:
    """Estimate of the thrust factor, and the conditions under which it changes.

    `factor`: true / assumed thrust, always within its bounds.
    """

    def __init__(
        self,
        parameters: ThrustIdentificationParameters | None = None,
        vehicle: VehicleDescription | None = None,
    ) -> None:
        """parameters: None for those of the vehicle; vehicle: None for the default one."""
        vehicle = vehicle or load_description()
        self._gravity = vehicle.gravity
        self.factor = 1.0
        self._time = -math.inf
        self._assumed = 0.0  # N, lagged as the motors
        self._ground: float | None = None  # m, height of the vehicle on the ground
        self._learnt = 0.0  # s of learning so far
        self._unsteady = -math.inf  # s, last time at which the flight was not steady
        self._switches: deque[tuple[float, bool]] = deque()
        self._magnet = False
        self._released: float | None = None  # s, magnet off; None once no payload hangs
        self._recent = math.nan  # measurement since the release, fast low pass
        self._before: float | None = None  # settled factor before the magnet went on
        self._steady_force = prepared(steady_force, np.zeros((3, 3)), 0.0, 0.0, 0.0)
        self.configure(parameters or ThrustIdentificationParameters.of(vehicle))

    def configure(self, parameters: ThrustIdentificationParameters) -> None:
        """Apply new parameters; a ParameterError names the bad one and changes nothing."""
        p = self.parameters = parameters.validated()
        self.factor = min(p.factor_max, max(p.factor_min, self.factor))

    def switch(self, time: float, on: bool) -> None:
        """Store the magnet's state at `time` [s]; it counts MAGNET_DELAY later."""
        if not math.isfinite(time):
            return
        if self._switches and time < self._switches[-1][0]:  # the clock was restarted
            self._switches.clear()
        self._switches.append((time, bool(on)))
        while len(self._switches) > 100:  # without calls of `update`: keep the latest
            self._switches.popleft()

    def update(
        self, time: float, state: np.ndarray, command: float, assumed: float, flying: bool
    ) -> float:
        """Advance by one tick and return `factor`.

        time [s]; state (3, 6 + n): see uam_control.coordinates; command: normalised thrust sent at
        this tick; assumed [N]: its collective by the curve, without the factor; flying: armed and
        controlled.
        """
        if not math.isfinite(time + assumed + command):
            return self.factor
        dt, self._time = time - self._time, time
        if not 0.0 < dt <= LONGEST_GAP:  # the first tick, or ticks are missing
            self._assumed, self._unsteady = assumed, time
            return self.factor
        p = self.parameters
        self._assumed += (1.0 - math.exp(-dt / max(p.identification_lag, 1e-3))) * (
            assumed - self._assumed
        )
        if self._switches:
            self._follow_magnet(time)
        if p.thrust_identification == "off":
            self._learnt = 0.0
            self._move(1.0 - self.factor, dt)
            return self.factor
        height = float(state[CHI, Z])
        if not flying or self._ground is None:
            self._land(height)
            self._unsteady = time
        elif not self._magnet and p.identification_height < height - self._ground < math.inf:
            self._compare(time, dt, state, command)
        return self.factor

    def _compare(self, time: float, dt: float, state: np.ndarray, command: float) -> None:
        """Measure the factor in steady flight and follow the measurement."""
        p = self.parameters
        limits = (p.identification_tilt, p.identification_acceleration)
        force = self._steady_force(state, *limits, self._gravity)
        if force == 0.0 or self._assumed <= 0.0 or not USABLE[0] <= command <= USABLE[1]:
            self._unsteady = time
        # A swaying vehicle is at rest for moments, and its motors saturate: rest must last.
        if time - self._unsteady <= p.identification_settling:
            return
        measured = p.identification_mass * force / self._assumed
        measured = min(p.factor_max, max(p.factor_min, measured))
        if self._released is not None and self._hanging(time, dt, measured):
            return
        if p.thrust_identification == "on":
            self._learnt += dt
            span = min(p.identification_time, max(p.identification_start, self._learnt))
            gain = 1.0 - math.exp(-dt / span)
            self._move(gain * (measured - self.factor), dt)

    def _hanging(self, time: float, dt: float, measured: float) -> bool:
        """Whether a payload may still hang on the magnet that is off."""
        p = self.parameters
        if math.isnan(self._recent):
            self._recent = measured
        self._recent += min(1.0, 2.0 * dt / p.identification_release) * (measured - self._recent)
        if time - self._released < p.identification_release:
            return True
        if self._before is None:  # the factor without payload is unknown: wait for the landing
            return True
        mass = p.identification_mass
        if self._recent < self._before * mass / (mass + p.hanging_mass):
            return True
        self._released = None
        return False

    def _follow_magnet(self, time: float) -> None:
        while self._switches and self._switches[0][0] <= time - MAGNET_DELAY:
            on = self._switches.popleft()[1]
            if on and not self._magnet:
                settled = self._learnt >= SETTLED * self.parameters.identification_start
                # if the last payload never came off, `_before` keeps its value
                if self._released is None:
                    self._before = self.factor if settled else None
            elif self._magnet and not on:
                self._released, self._recent = time, math.nan
            self._magnet = on

    def _land(self, height: float) -> None:
        if math.isfinite(height):
            self._ground = height
        self._released = None

    def _move(self, step: float, dt: float) -> None:
        p = self.parameters
        limit = p.factor_slew * dt
        step = min(limit, max(-limit, step))
        self.factor = min(p.factor_max, max(p.factor_min, self.factor + step))
