"""Selection and rate of the mocap poses sent to the autopilot's estimator."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from uam_control.ages import FORWARDED
from uam_control.coordinates import ALPHA, CHI, CHI_DOT
from uam_control.estimation.pose_clock import AGREED, counts, new_clock, no_pose, repeated
from uam_control.maths.compiled import borrowing, prepared
from uam_control.maths.kept_tuple import bound
from uam_control.maths.memory import put, record
from uam_control.setpoints.targets import VisionPose
from uam_control.settings.parameter_set import ParameterSet, number
from uam_control.stages.autopilot_port import AutopilotPort

# [m] by which a pose may be off the estimate: more than an estimate drifts without poses before the
# failsafe; PX4's EKF2 rejects a pose at 5 standard deviations, about as much
BEYOND = 0.5
CLOSE = 0.15  # [m] the same within AGREED after such a pose: exchanged axes may come near


@dataclass(frozen=True)
class VisionParameters(ParameterSet):
    """Rate and accuracy of the poses sent."""

    vision_interval: float = number(0.02, "least time between two vision poses sent", "s", 0.0, 1.0)
    vision_position_deviation: float = number(
        0.005, "standard deviation sent with a vision pose", "m", 1e-4, 1.0
    )
    vision_attitude_deviation: float = number(
        0.02, "standard deviation sent with a vision pose", "rad", 1e-4, 1.0
    )


class VisionArrays(NamedTuple):
    """State of a `VisionPacing`."""

    pose: np.ndarray  # (7,) newest position and quaternion
    last: np.ndarray  # (7,) see `repeated`
    clock: np.ndarray  # (1,) see `counts`
    # (1,) whether the pose waits; [s]: its exposure, the last sent, interval, the last off the
    # estimate
    numbers: np.ndarray


class VisionPacing:
    """Stores the newest pose and sends it when the interval has passed.

    PX4 recommends 30 to 50 Hz: a higher rate does not improve its EKF and loads a serial line.
    """

    def __init__(self, parameters: VisionParameters) -> None:
        p, numbers = parameters, record("waits", "exposed sent interval off")
        numbers[0] = False, 0.0, -1.0, p.vision_interval, -math.inf
        self.arrays = VisionArrays(np.zeros(7), no_pose(), new_clock(), numbers)
        self._deviations = p.vision_position_deviation, p.vision_attitude_deviation
        self._unknown = np.full((3, ALPHA), math.nan)
        still = np.zeros(3)
        self.take = bound(take_pose, self.arrays, 0.0, still, np.zeros(4), True)
        self._due = prepared(pose_due, self.arrays, 0.0, self._unknown, True)

    def send(self, autopilot: AutopilotPort, now: float, state: np.ndarray | None) -> None:
        """Send the newest pose if it is due at `now` [s], see `pose_due`.

        state (3, 6 + n): estimate of an armed vehicle, None if there is none.
        """
        known = state is not None
        if self._due(self.arrays, now, state if known else self._unknown, known):
            pose, exposed = self.arrays.pose.copy(), self.arrays.numbers["exposed"].item()
            autopilot.send_vision(VisionPose(exposed, pose[:3], pose[3:], *self._deviations))


@borrowing
def take_pose(
    a: VisionArrays, exposed: float, position: np.ndarray, quaternion: np.ndarray, armed: bool
) -> bool:
    """Store a pose of `exposed` [s]; return whether it is used.

    position (3,) [m, ENU]; quaternion (4,) [w x y z], FLU → ENU. In flight (`armed`) a pose
    equal to the one before is discarded: the tracker is frozen.
    """
    if repeated(position, quaternion, a.last) and armed:
        return False
    m = a.numbers[0]
    put(a.last, a.pose)
    m.waits, m.exposed = True, exposed
    return True


@borrowing
def pose_due(a: VisionArrays, now: float, state: np.ndarray, known: bool) -> bool:
    """Return whether to send the pose at `now` [s]: due, not too old, and of a right clock.

    state (3, 6 + n): used if `known`. A pose that it contradicts is discarded: the autopilot would
    follow it.
    """
    m = a.numbers[0]
    if not m.waits or not counts(a.clock, m.exposed, now, FORWARDED):
        return False
    if not m.exposed - m.sent >= m.interval - 1e-9:
        return False
    m.waits = False
    limit = BEYOND if m.exposed - m.off > AGREED else CLOSE
    if known and beyond(a.pose[:3], state, now - m.exposed) > limit:
        m.off = m.exposed
        return False
    m.sent = m.exposed
    return True


@borrowing
def beyond(position: np.ndarray, state: np.ndarray, age: float) -> float:
    """Return the distance [m] of a pose's position (3,) from the estimate (3, 6 + n), less the way
    that the vehicle goes in the pose's age [s]."""
    distance = speed = 0.0
    for i in range(3):
        distance += (position[i] - state[CHI, i]) ** 2
        speed += state[CHI_DOT, i] ** 2
    return math.sqrt(distance) - abs(age) * math.sqrt(speed)
