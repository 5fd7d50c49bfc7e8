"""A joint whose reading stays the same while its torque and its reference change.

A joint at rest carries tau_0 with the friction of one side, and tau with that of the other. Beyond

    |tau - tau_0| <= 2 F_c + mu (|tau| + |tau_0|)

it must move, unless its load has changed: what other joints do moves it, too. Its load is between
that of tau_0 and the known one of the reference, so the torque must be beyond with both of them. If
the reading then does not change, the encoder is stuck or the joint is: no feedback by this
reading moves it to where it should be. F_c and mu are those of hard servos with a margin: of 1,500
joints in healthy flights none reached the bound, and none was for more than 0.1 s beyond its share
SOON. A reference that stands still, as of a joint that carries a load at rest, contradicts nothing.
"""

import math

import numpy as np

from uam_control.maths.compiled import borrowing
from uam_control.maths.memory import record

STILL = 3e-4  # [rad] a fifth of a count of 4096 per turn
FREE = 0.01  # [rad] by which a joint that stands must move to count as free: a stuck one creeps
DRY, LOAD = 0.06, 0.4  # F_c as a share of the largest torque; mu
SOON = 0.7  # share of the bound for one who waits, and sees it before the torque is taken away
LEFT = math.radians(2.0)  # [rad] by which the reference must have left the reading


def still_joints(count: int) -> np.ndarray:
    """Return the memory (count,) of `stands`: whether it does; the last change's angle [rad],
    NaN at first, reference [rad], torque and its known part [N m]."""
    memory = record("stands", "angle wanted torque known", count)
    memory["angle"] = math.nan
    return memory


@borrowing
def stands(
    memory: np.ndarray,
    i: int,
    angle: float,
    wanted: float,
    torque: float,
    known: float,
    largest: float,
    share: float,
) -> bool:
    """Return whether the reading of joint i contradicts its torque, until it changes by FREE.

    angle: the reading, wanted: the reference [rad]; torque, its part for the known load, and the
    servo's largest one [N m]; share: of the bound.
    """
    m = memory[i]
    if not abs(angle - m.angle) <= (FREE if m.stands else STILL):
        m.stands, m.angle, m.wanted = 0, angle, wanted
        m.torque, m.known = torque, known
    held = 2.0 * DRY * largest + LOAD * (abs(torque) + abs(m.torque))
    change = torque - m.torque
    beside = change - (known - m.known)
    beyond = change * beside > 0.0 and min(abs(change), abs(beside)) > share * held
    if beyond and abs(wanted - m.wanted) > LEFT:
        m.stands = 1
    return m.stands != 0
