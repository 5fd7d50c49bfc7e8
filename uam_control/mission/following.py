"""The compiled part of the guidance: the reference of a motion, and of motions computed ahead."""

from typing import NamedTuple

import numpy as np

from uam_control.maths.compiled import borrowing
from uam_control.maths.memory import put
from uam_control.mission.motion.flatness import write_reference

# following: number of the next of the motions ahead
WHOLE, REAL = "following", "scenario_time gravity rate_max acceleration_max"
MOST = 64  # motions ahead


class GuidanceArrays(NamedTuple):
    """reference, motion: of `Guidance`; motions (MOST, 5, 6 + n), times (MOST,) [s]: ahead, on the
    path; drag (3,) [1/s]; numbers (1,): WHOLE, REAL."""

    reference: np.ndarray
    motion: np.ndarray
    motions: np.ndarray
    times: np.ndarray
    drag: np.ndarray
    numbers: np.ndarray


@borrowing
def publish(a: GuidanceArrays) -> None:
    """Write the motion to the reference, with the attitude that it needs."""
    m = a.numbers[0]
    write_reference(a.motion, a.drag, m.gravity, m.rate_max, m.acceleration_max, a.reference)


@borrowing
def follow_path(a: GuidanceArrays) -> None:
    """Write the next motion that `Guidance.look_ahead` has computed, and its reference."""
    m = a.numbers[0]
    m.scenario_time = a.times[m.following]
    for row in range(len(a.motion)):
        put(a.motions[m.following, row], a.motion[row])
    m.following += 1
    publish(a)
