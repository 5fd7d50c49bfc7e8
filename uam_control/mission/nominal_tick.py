"""A tick of the mission in which nothing is decided, compiled: the reference follows the path."""

from typing import NamedTuple

import numpy as np

from uam_control.ages import SILENT
from uam_control.coordinates import CHI, Z
from uam_control.maths.compiled import borrowing
from uam_control.mission.following import GuidanceArrays, follow_path
from uam_control.mission.ground import on_ground
from uam_control.supervision.checks import CheckArrays, measure_all
from uam_control.supervision.observation import NUMBERS, ReadingArrays
from uam_control.supervision.supervisor import stays_behind


class MissionArrays(NamedTuple):
    """State of a `Mission`: of its guidance and checks; supervisor, watch, numbers (1,): memory of
    its supervisor, its `PayloadWatch` and itself, see WHOLE and REAL."""

    guidance: GuidanceArrays
    checks: CheckArrays
    supervisor: np.ndarray
    watch: np.ndarray
    numbers: np.ndarray


AUTOPILOT_AGE = NUMBERS.index("autopilot_age")
# takes_off: whether the vehicle is not airborne yet. [s]: newest step, take-off; ground [m] below
# it; height [m], speed [m/s] of a touchdown, and scenario time [s] from which on it is one
WHOLE, REAL = "takes_off", "stamp takeoff ground height speed half"


@borrowing
def follow_scenario(
    a: MissionArrays, readings: ReadingArrays, stamp: float, state: np.ndarray
) -> bool:
    """Do what `Mission.step` does at `stamp` [s], after `Mission.look_ahead`.

    state (3, 6 + n). Returns False, and changes nothing, where something is to be decided.
    """
    m, path, s = a.numbers[0], a.guidance, a.supervisor[0]
    calm = measure_all(a.checks, state, path.reference, m.ground, readings, True)
    late = path.times[path.numbers[0].following] >= m.half
    if not calm or (late and on_ground(state, m.ground, m.height, m.speed)):
        return False
    if readings.values[AUTOPILOT_AGE] > SILENT:  # the arm may give way, see `Mission`
        return False
    if m.takes_off:
        planned = path.reference[CHI, Z] - m.ground
        airborne = state[CHI, Z] - m.ground > s.airborne_height
        if airborne or stays_behind(a.supervisor, stamp, planned):
            return False
    m.stamp = stamp
    s.stamp = stamp
    follow_path(path)
    return True
