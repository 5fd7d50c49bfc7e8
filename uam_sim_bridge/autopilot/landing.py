"""Land detector of a multicopter, with PX4's three stages.

Ground contact: low thrust, no motion. Maybe landed: minimal thrust, no rotation. Landed: both for
some time. Each stage takes a third of LNDMC_TRIG_TIME; a violated condition resets it at once.
"""

import math
from collections.abc import Sequence

import numpy as np

from uam_sim_bridge.autopilot.params import Parameters

_LOW_THRUST = 0.3  # fraction of the range from smallest to hover thrust (PX4)
_NO_THRUST = 0.1
_WIDER = 2.5  # factor on the motion thresholds while maybe landed (PX4)


class LandDetector:
    """`landed` is true on the ground and while disarmed; `maybe_landed` freezes the integrals;
    `contact`: the ground is touched; `low`: thrust up to which there may be evidence of that."""

    def __init__(self, parameters: Parameters) -> None:
        self.landed = True
        self.maybe_landed = True
        self.contact = True
        self._since = [-math.inf, -math.inf, -math.inf]  # [s] begin of the evidence of each stage
        self.configure(parameters)

    @property
    def flies(self) -> bool:
        """Whether there is no evidence of any stage."""
        return self._since == [math.inf] * 3

    def configure(self, parameters: Parameters) -> None:
        least, hover = parameters["MPC_THR_MIN"], parameters["MPC_THR_HOVER"]
        self.low = least + _LOW_THRUST * (hover - least)
        self._none_descending = least + _NO_THRUST * (hover - least)
        self._none = parameters["MPC_MANTHR_MIN"] + 0.01
        self._rotation = math.radians(parameters["LNDMC_ROT_MAX"])
        self._vertical = parameters["LNDMC_Z_VEL_MAX"]
        self._horizontal = parameters["LNDMC_XY_VEL_MAX"]
        self._stage_time = parameters["LNDMC_TRIG_TIME"] / 3.0

    def update(
        self,
        time: float,
        armed: bool,
        descending: bool,
        thrust: float,
        rates: Sequence[float] | np.ndarray,
        velocity: Sequence[float] | np.ndarray | None,
    ) -> None:
        """Update the stages with this tick's thrust command, body rates [rad/s], roll and pitch
        first, and velocity [m/s, NED].

        velocity: None where it is not valid: low thrust alone then means ground contact.
        """
        if not armed:
            self.contact = self.maybe_landed = self.landed = True
            return
        if thrust > self.low:  # as in all of a flight: no evidence of any stage
            self._since[:] = math.inf, math.inf, math.inf
            self.contact = self.maybe_landed = self.landed = False
            return
        wider = _WIDER if self.maybe_landed else 1.0
        contact = thrust <= self.low and (
            velocity is None
            or abs(velocity[2]) <= wider * self._vertical
            and math.hypot(velocity[0], velocity[1]) <= self._horizontal
        )
        still = math.hypot(rates[0], rates[1]) <= wider * self._rotation
        none = thrust <= (self._none_descending if descending else self._none)
        since, reached = self._since, [self.contact, self.maybe_landed, self.landed]
        evidence = True
        for stage, condition in enumerate((contact, still and none, True)):
            if evidence and condition:
                if since[stage] > time:
                    since[stage] = time
                evidence = reached[stage] or time - since[stage] >= self._stage_time
            else:
                since[stage], evidence = math.inf, False
            reached[stage] = evidence
        self.contact, self.maybe_landed, self.landed = reached
