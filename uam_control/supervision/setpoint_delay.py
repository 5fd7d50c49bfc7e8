"""How much later than in the profile's model the setpoints act, from what is measured.

Before take-off: `delay_share_of_round_trip` of the round trip, as all of it may be on the way to
the autopilot. In flight: the larger of the measured loop delay beyond `delay_nominal` and half of
the round trip.

The loop delay is unknown while the vehicle hardly moves. A loop that begins to oscillate moves.
"""

from __future__ import annotations

import math

from uam_control.supervision.observation import Readings
from uam_control.supervision.supervision_parameters import SupervisionLimits

SYMMETRIC = 0.5  # share of the round trip that is on the way to the autopilot, if both are alike


def setpoint_delay(readings: Readings, limits: SupervisionLimits, in_flight: bool) -> float:
    """Return the delay of the setpoints [s], NaN if unknown."""
    share = SYMMETRIC if in_flight else limits.delay_share_of_round_trip
    by_link = share * readings.round_trip
    if not in_flight or math.isnan(readings.loop_delay):
        return by_link
    late = max(readings.loop_delay - limits.delay_nominal, 0.0)
    return late if math.isnan(by_link) else max(late, by_link)


def margin_left(delay: float, limits: SupervisionLimits) -> float:
    """Return the share of the margin that is left, below 0 beyond it; NaN for an unknown delay."""
    return 1.0 - delay / limits.delay_margin
