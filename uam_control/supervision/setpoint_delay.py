"""How much later than in the profile's model the setpoints act, from what is measured.

Before take-off: `delay_share_of_round_trip` of the round trip, as all of it may be on the way to
the autopilot. In flight: the larger of half of the round trip and of the measured loop delay beyond
`delay_nominal`. The supervisor checks both apart: the round trip is a clock's difference, the loop
delay a fit, for which it needs `delay_after` of evidence.

The loop delay is unknown while the vehicle hardly moves, and while something else moves it. A loop
that begins to oscillate moves.
"""

import math

from uam_control.maths.compiled import borrowing
from uam_control.supervision.supervision_parameters import SupervisionLimits

SYMMETRIC = 0.5  # share of the round trip that is on the way to the autopilot, if both are alike


@borrowing
def by_link(round_trip: float, share: float, in_flight: bool) -> float:
    """Return the delay [s] that the round trip [s] shows, NaN if unknown; share: on the ground."""
    return (SYMMETRIC if in_flight else share) * round_trip


@borrowing
def by_loop(loop_delay: float, nominal: float, in_flight: bool) -> float:
    """Return the delay [s] that the loop delay [s] shows, NaN if unknown; it counts in flight."""
    if not in_flight:
        return math.nan
    late = loop_delay - nominal
    return 0.0 if late < 0.0 else late


@borrowing
def larger(link: float, loop: float) -> float:
    """Return the larger of two delays [s]; NaN only if both are unknown."""
    return loop if math.isnan(link) or loop > link else link


def margin_left(delay: float, limits: SupervisionLimits) -> float:
    """Return the share of the margin that is left, below 0 beyond it; NaN for an unknown delay."""
    return 1.0 - delay / limits.delay_margin
