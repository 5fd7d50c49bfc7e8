"""What the bridge measures in flight, from the setpoints it sends and the motion that follows.

One compiled call per tick: loop delay, thrust factor, lift and throttle.
"""

import math
from typing import NamedTuple

import numpy as np

from uam_control.coordinates import ALPHA, CHI_DOT, ROLL
from uam_control.maths.compiled import borrowing
from uam_control.maths.kept_tuple import bound
from uam_control.setpoints.loop_delay import DelayNumbers, DelaySums, LoopDelay, follow, pause
from uam_control.setpoints.thrust_curve import thrust_of_command
from uam_control.setpoints.thrust_identification import (
    ThrustIdentification,
    ThrustIdentificationParameters,
    identify,
)
from uam_control.vehicle import VehicleDescription

LIFT_CUTOFF = 1.0  # [Hz]
Curve = tuple[float, float, float, float]  # see `RateThrustMap.curve`


class MeasurementArrays(NamedTuple):
    """State of the measurements."""

    sums: DelaySums  # of the loop delay
    delay: DelayNumbers  # of the loop delay
    record: np.ndarray  # (1,) of the thrust identification
    memory: np.ndarray  # (1,) of the thrust identification
    lift: np.ndarray  # (2,) low-passes of the collective [N], of the normalised thrust


class Sent(NamedTuple):
    """What was sent at a tick."""

    rates: np.ndarray  # (3,) [rad/s, FLU]
    thrust: float  # 0..1
    looped: bool  # whether the laws made the setpoint of a flying vehicle
    flown: bool  # whether the thrust acts on it
    factor: float  # of the thrust, used for the setpoint


@borrowing
def measure(
    a: MeasurementArrays, now: float, step: float, state: np.ndarray, sent: Sent, curve: Curve
) -> float:
    """Advance the measurements by one tick; return the new thrust factor.

    now [s]; step [s]: since the last tick, for the low-passes; state (3, 6 + n).
    """
    sums, delay, record, memory, lift = a
    thrust = sent.thrust
    if sent.looped:
        follow(now, sent.rates, state[CHI_DOT, ROLL:ALPHA], sums, delay)
    else:
        pause(sums)
    assumed = thrust_of_command(thrust, curve[0], curve[1], curve[2], curve[3])
    gain = 1.0 - math.exp(-2.0 * math.pi * LIFT_CUTOFF * step)
    lift[0] += gain * (sent.factor * assumed - lift[0])
    lift[1] += gain * (thrust - lift[1])
    flown = sent.flown and math.isfinite(thrust)
    return identify(now, state, thrust, assumed, flown, record, memory)


class FlightMeasurements:
    """The measurements: `loop_delay`, `identification`, and the `lift` (2,): low-passes at
    LIFT_CUTOFF of the collective [N] by the thrust factor used, and of the normalised thrust."""

    def __init__(
        self, parameters: ThrustIdentificationParameters, vehicle: VehicleDescription
    ) -> None:
        self.identification = ThrustIdentification(parameters, vehicle)
        self.loop_delay = LoopDelay(vehicle.rotor.lag, vehicle.control_period)
        self.lift = np.zeros(2)
        memory = self.identification.record, self.identification.memory
        delay = self.loop_delay.sums, self.loop_delay.numbers
        self.arrays = MeasurementArrays(*delay, *memory, self.lift)
        tick = 0.0, 0.0, np.zeros((3, ALPHA)), Sent(np.zeros(3), 0.0, True, True, 1.0), 4 * (0.0,)
        self._measure = bound(measure, self.arrays, *tick)

    def update(self, now: float, step: float, state: np.ndarray, sent: Sent, curve: Curve) -> float:
        """Take a tick and return the new thrust factor; see `measure`."""
        if self.identification.magnet_waits:
            self.identification.follow_magnet(now, math.isfinite(now + sent.thrust))
        return self._measure(now, step, state, sent, curve)
