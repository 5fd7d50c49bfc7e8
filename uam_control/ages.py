"""The one table of the ages of data [s]: how old a sample may be, and for whom.

An age is the stamp of the newest tick, in the autopilot that of its newest cycle, less the stamp of
the sample. Whoever judges a sample by its age takes the number from here: as it is, or as default
of a parameter.
"""

import math

from uam_control.maths.compiled import borrowing

# [s], in order of their size
AHEAD_FOR = 0.02  # of the IMU while poses are further ahead: more than samples in a burst
AHEAD = 0.05  # a pose may be so far ahead of the IMU, or behind the last one: more is a wrong clock
STALE = 0.1  # commands, a bias of the IMU: no longer valid; poses: no take-off
FORWARDED = 0.25  # poses: to the autopilot, and in the comparisons of supervisor and grasp
HOLD = 0.25  # poses, joint angles, gains of a controller: the vehicle holds, then lands
UNAIDED = 0.5  # without a pose for so long an estimate may be far off, in the autopilot, too
SILENT = 0.5  # reports of the bridge: nobody may follow the mission any more
LAND = 0.75  # reports of autopilot and bridge: the vehicle lands
FAILSAFE = 1.0  # poses, and the estimate: the autopilot descends by itself
BRIDGED = FAILSAFE  # poses: the estimate's past reaches back so far; an older one is none for all
REJECTED_LATE = 2.0  # poses off the estimate and older than FORWARDED: for so long rejected
DISCONNECTED = 3.0  # heartbeats of the autopilot
REJECTED = 10.0  # poses off the estimate: for so long; a failsafe is on the ground before
OTHER_CLOCK = 10.0  # stamps: of a clock that the autopilot does not know, not of an old pose


@borrowing
def usable(age: float, oldest: float) -> bool:
    """Return whether a pose of this age [s] is one for a consumer of poses up to `oldest` [s]."""
    return -AHEAD <= age <= oldest


@borrowing
def age_by(stamp: float, time: float) -> float:
    """Return the age [s] that the autopilot gives a pose of `stamp` [s] at `time` [s].

    0 for a stamp of another clock, as before TIMESYNC has an answer; infinite for a pose that it
    does not use.
    """
    age = time - stamp
    if abs(age) > OTHER_CLOCK:
        return 0.0
    return age if usable(age, FORWARDED) else math.inf
