"""Poses that do not count: of a clock that has jumped, of a frozen tracker, or of a jump.

A frozen tracker repeats its last pose exactly, without noise. The stamps of a clock that has jumped
say a wrong age. A late pose has a right stamp, and stamps never go back. Poses whose clock is
behind would be compared with an estimate of too early a time: the estimate leads, and the position
loop swings up. Poses that are ahead while samples keep coming would count late.

The gate detects jumps only, as of another body taken for the vehicle. The estimate follows wrong
poses that drift slowly; then the return to the true pose is the jump and must not be rejected. In
that case motion capture and IMU contradict each other, and the estimated accelerometer bias is
large: the gate then accepts all poses.

Wrong poses may pass through the true place, as those of exchanged axes do. So where no pose has
agreed for BRIEF, those that agree count only after AGREED.
"""

import math

import numpy as np

from uam_control.ages import AHEAD, AHEAD_FOR, UNAIDED, usable
from uam_control.maths.compiled import borrowing
from uam_control.maths.memory import record

# newest [s]: stamp of the newest pose that counted, age [s]: of that at its arrival; ahead_since
# [s]: stamp of the IMU since which every pose is far ahead, inf: the last one was not
WHOLE, REAL = "behind", "newest age ahead_since"
POSITION, POSE = 3, 7
CONTRADICTED = 1.0  # m/s^2, accelerometer bias larger than that of any real accelerometer
MEMORY = 1.0  # s, no rejection for this time after such a bias or gap
BRIEF, AGREED = 0.1, 0.5  # s, see above; single poses that are wrong come for less
# distance [m]: from the estimate, above which a pose is rejected; stamps [s]; rejecting_since: NaN
# while no pose is rejected; off, near: of the last pose that was not near, and was; near_since
GATE = "distance suspended last interrupted rejecting_since off near near_since"


def no_pose() -> np.ndarray:
    """Return position and quaternion (7,) of the newest pose before the first: NaN."""
    return np.full(POSE, math.nan)


@borrowing
def repeated(position: np.ndarray, quaternion: np.ndarray, newest: np.ndarray) -> bool:
    """Return whether position (3,) and quaternion (4,) equal newest (7,) exactly; keep them there.

    0 and -0 differ, as in their bytes.
    """
    same = True
    for i in range(POSE):
        value = position[i] if i < POSITION else quaternion[i - POSITION]
        before = newest[i]
        if value != before or math.copysign(1.0, value) != math.copysign(1.0, before):
            same = False
        newest[i] = value
    return same


def new_clock() -> np.ndarray:
    """Return the memory (1,) of the clock of poses, see `counts`."""
    clock = record(WHOLE, REAL)
    forget_clock(clock)
    return clock


@borrowing
def forget_clock(clock: np.ndarray) -> None:
    """Know no pose; clock (1,): see `new_clock`."""
    m = clock[0]
    m.behind = False
    m.newest = -math.inf
    m.age = m.ahead_since = math.inf


@borrowing
def counts(clock: np.ndarray, stamp: float, now: float, oldest: float) -> bool:
    """Return whether a pose of `stamp` [s] counts at `now` [s]; clock: see `new_clock`.

    It is `usable` up to an age of `oldest` [s]. After stamps that went back no pose counts
    until one is about as young as the last that did.
    """
    m, age = clock[0], now - stamp
    if not usable(age, oldest):
        return False
    if stamp < m.newest - AHEAD:
        m.behind = True
    if m.behind and age > m.age + AHEAD:
        return False
    m.newest, m.age, m.behind = stamp, age, False
    return True


@borrowing
def waits(clock: np.ndarray, stamp: float, newest: float) -> bool:
    """Return whether a pose of `stamp` [s] may wait for its IMU sample; newest [s]: of the IMU.

    An IMU that pauses leaves poses far ahead. They are an error of the clock if samples come in
    between: before one of them would be used, at an age that it does not have.
    """
    m = clock[0]
    m.ahead_since = min(m.ahead_since, newest) if stamp - newest > AHEAD else math.inf
    return newest - m.ahead_since <= AHEAD_FOR


def new_gate() -> np.ndarray:
    """Return the memory (1,) of the gate of poses, see `rejects`; refused: how many it has."""
    gate = record("refused", GATE)
    forget_rejections(gate)
    return gate


@borrowing
def forget_rejections(gate: np.ndarray) -> None:
    """Begin anew; gate (1,): see `new_gate`. The distance stays."""
    m = gate[0]
    m.refused = 0
    m.suspended = m.last = m.interrupted = -math.inf
    m.off = m.near = m.near_since = -math.inf
    m.rejecting_since = math.nan


@borrowing
def rejects(gate: np.ndarray, stamp: float, distance: float, bias: float, longest: float) -> bool:
    """Return whether to reject the pose at `stamp` [s]; gate: see `new_gate`.

    distance [m]: between the pose and the estimate at its stamp; bias [m/s^2]: norm of the
    estimated accelerometer bias; longest [s]: of a rejection.
    """
    m = gate[0]
    if stamp - m.last > UNAIDED:
        suspend(gate, stamp)
    elif math.isnan(m.rejecting_since) and bias > CONTRADICTED:
        m.suspended = stamp
    m.last = stamp
    trusted = stamp - m.suspended > MEMORY
    agrees = agreed_for(gate, stamp, trusted and distance > m.distance) > AGREED
    if agrees or not trusted:
        m.rejecting_since = math.nan
        return False
    if math.isnan(m.rejecting_since):
        m.rejecting_since = stamp
    if stamp - m.rejecting_since > longest:
        m.rejecting_since = math.nan
        suspend(gate, stamp)
        return False
    m.refused += 1
    return True


@borrowing
def agreed_for(gate: np.ndarray, stamp: float, off: bool) -> float:
    """Return for how long [s] poses have agreed at `stamp` [s], 0 for one that is off."""
    m = gate[0]
    if off:
        m.off = stamp
        return 0.0
    if m.off > m.near and stamp - m.near > BRIEF:
        m.near_since = stamp
    m.near = stamp
    return stamp - m.near_since


@borrowing
def suspend(gate: np.ndarray, stamp: float) -> None:
    """Reject no pose for MEMORY from `stamp` [s] on: the estimate may have a large error."""
    m = gate[0]
    m.suspended = m.interrupted = stamp


@borrowing
def settled(gate: np.ndarray, stamp: float) -> bool:
    """Return whether the estimate at `stamp` [s] has recovered from the last interruption.

    Until then the estimated biases change fast, by the return of the poses alone.
    """
    return stamp - gate[0].interrupted > MEMORY
