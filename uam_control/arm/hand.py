"""The end effector in the world, of a base with any attitude: place, heading, elevation.

Heading: of the horizontal across the tool's y axis; elevation: of its x axis above the horizontal,
about its y axis (R = Rz(heading) Rx(lean) Ry(-elevation)). So both exist however an arm folds; they
are lost only where the tool's y axis stands upright.
"""

import math
from collections.abc import Sequence
from functools import partial

import numpy as np

from uam_control.arm.chain import Chain
from uam_control.arm.kinematics import DOWN, hand_jacobian, hand_pose, hanging, last_link
from uam_control.coordinates import ARM, ATTITUDE, POSITION
from uam_control.maths.compiled import borrowing, jit
from uam_control.maths.rotations import matrix_from_euler, wrap_angle, wrapped
from uam_control.maths.vectors import (
    Rows,
    Vector,
    about,
    dot,
    plus,
    product,
    rows,
    times,
    transposed,
    turned,
    vector,
)

HAND = X, Y, Z, HEADING, ELEVATION = range(5)  # columns
LEAN = 5  # a further one of TOOL: of the tool's y axis above the horizontal [rad]
TOOL = (*HAND, LEAN)
STEP = 1e-6  # [rad] of numerical derivatives
NONE = 1e-9  # relative, of a singular value that counts as zero
UP = 1e-3  # [rad] of the hinge of an arm that points up, from half a turn
UPRIGHT = 0.9  # of the z component of a joint's axis, from which on it is a yaw joint
# relative to the slopes' squared size; absolute, for slopes of zero
DAMPING, LEAST = 1e-9, 1e-30
STARTS = 24  # of the search, a fixed set
INSIDE = 1e-9  # of a range, in which a search begins
SEARCH_STEP = math.radians(5.0)  # of the search
GAIN = 1e-3  # relative, by which another posture must be better; less does not count


@jit
def hand_in_world(chain: Chain, chi: np.ndarray) -> tuple[Vector, Rows]:
    """Return place [m] and rotation of the end effector in the world; chi (6 + n,).

    A hand on a hinge hangs straight down.
    """
    rotation = rows(matrix_from_euler(chi[ATTITUDE]))
    return _placed(chain, chi, rotation, times(-1.0, rotation[2]))


@borrowing
def _placed(chain: Chain, chi: np.ndarray, rotation: Rows, down: Vector) -> tuple[Vector, Rows]:
    """Return what `hand_in_world` does, for a hand that hangs along `down`, in the base frame."""
    place, turn = hand_pose(chain, chi[ARM], down)
    return plus(vector(chi[POSITION]), turned(rotation, place)), product(rotation, turn)


@borrowing
def heading(turn: Rows) -> float:
    """Return the heading [rad] of a tool with this rotation to the world."""
    return math.atan2(-turn[0][1], turn[1][1])


@borrowing
def elevation(turn: Rows) -> float:
    """Return the elevation [rad] of a tool with this rotation to the world."""
    return math.atan2(turn[2][0], turn[2][2])


@borrowing
def lean(turn: Rows) -> float:
    """Return how far [rad] the y axis of a tool with this rotation to the world is raised."""
    return math.asin(min(1.0, max(-1.0, turn[2][1])))


@borrowing
def _swung(chain: Chain, angles: np.ndarray, swing: float) -> Vector:
    """Return where down is in the base, for a hand whose hinge stands at `swing` [rad]."""
    turn = product(last_link(chain, angles)[1], about(vector(chain.swing_axis), swing))
    load = turned(turn, vector(chain.swing_centre))
    return times(1.0 / math.sqrt(dot(load, load)), load)


@jit
def _write_tools(chain: Chain, chi: np.ndarray, swing: np.ndarray, found: np.ndarray) -> None:
    """Write TOOL (m, 6) of poses chi (m, 6 + n) with hinges at swing (m,) [rad]; NaN: they hang."""
    for i in range(len(chi)):
        rotation = rows(matrix_from_euler(chi[i, ATTITUDE]))
        down = times(-1.0, rotation[2])
        if not math.isnan(swing[i]):
            down = _swung(chain, chi[i, ARM], swing[i])
        place, turn = _placed(chain, chi[i], rotation, down)
        for k in range(3):
            found[i, k] = place[k]
        found[i, HEADING], found[i, ELEVATION] = heading(turn), elevation(turn)
        found[i, LEAN] = lean(turn)


def hands(chain: Chain, chi: np.ndarray, swing: np.ndarray | None = None) -> np.ndarray:
    """Return HAND (m, 5) [m, rad] of poses chi (m, 6 + n); swing: see `tools`."""
    return tools(chain, chi, swing)[:, : len(HAND)].copy()


def tools(chain: Chain, chi: np.ndarray, swing: np.ndarray | None = None) -> np.ndarray:
    """Return TOOL (m, 6) [m, rad] of poses chi (m, 6 + n), see `coordinates`.

    swing (m,) [rad]: angle of the hinge of a hand that hangs; NaN, or None: straight down.
    """
    found = np.empty((len(chi), len(TOOL)))
    if swing is None or not np.any(chain.swing_axis):
        swing = np.full(len(chi), np.nan)
    _write_tools(chain, np.ascontiguousarray(chi), np.ascontiguousarray(swing), found)
    return found


@jit
def hinge_angles(chain: Chain, angles: np.ndarray) -> np.ndarray:
    """Return where the hinge stands (m,) [rad] on which a hand hangs, of a level base.

    angles (m, n) [rad]. Counted from the arm at zero on without a jump: an arm that turns over in
    one direction takes a hinge over its end, not past it. An arm that points up at zero hangs to
    the side to which it turns. 0 for a hand that does not hang.
    """
    found, axis = np.zeros(len(angles)), vector(chain.swing_axis)
    if dot(axis, axis) == 0.0:
        return found
    for i in range(len(angles)):
        last = last_link(chain, angles[i])[1]
        turn = product(transposed(last), hanging(chain, last, DOWN))
        twist = (turn[2][1] - turn[1][2], turn[0][2] - turn[2][0], turn[1][0] - turn[0][1])
        found[i] = math.atan2(dot(axis, twist), turn[0][0] + turn[1][1] + turn[2][2] - 1.0)
        rolled = 0.0
        for k in range(angles.shape[1]):
            rolled -= angles[i, k] * dot(axis, vector(chain.axes[k]))
        first = wrapped(found[i] - rolled)  # of the arm at zero
        if abs(first) > math.pi - UP:
            first = -math.copysign(math.pi, rolled)
        found[i] = rolled + first
    return found


def jacobians(chain: Chain, chi: np.ndarray, columns: Sequence[int]) -> np.ndarray:
    """Return the derivatives (m, 6, k) of TOOL with respect to `columns` of chi (m, 6 + n)."""
    now, found = tools(chain, chi), np.empty((len(chi), len(TOOL), len(columns)))
    for number, column in enumerate(columns):
        moved = chi.copy()
        moved[:, column] += STEP
        change = tools(chain, moved) - now
        change[:, HEADING:] = wrap_angle(change[:, HEADING:])
        found[:, :, number] = change / STEP
    return found


def least_change(slopes: np.ndarray, off: np.ndarray) -> np.ndarray:
    """Return the least changes (m, k) that change values (m, r) by `off`; slopes (m, r, k)."""
    square = slopes @ slopes.swapaxes(1, 2)
    size = np.trace(square, axis1=1, axis2=2)[:, None, None] + LEAST
    solved = np.linalg.solve(square + DAMPING * size * np.eye(square.shape[1]), off[:, :, None])
    return (slopes.swapaxes(1, 2) @ solved)[:, :, 0]


def _slopes(chain: Chain, angles: np.ndarray) -> np.ndarray:
    """Return the velocity (3, n) [m/rad] of the hand per joint rate, for a level base."""
    jacobian = np.empty((6, len(angles)))
    hand_jacobian(chain, np.asarray(angles, dtype=float), DOWN, jacobian)
    return jacobian[POSITION]


def stretch(chain: Chain, angles: np.ndarray) -> np.ndarray:
    """Return the singular values [m/rad], largest first, of the hand's velocity in the base."""
    return np.linalg.svd(_slopes(chain, angles), compute_uv=False)


def freedom(chain: Chain) -> int:
    """Return in how many directions the hand moves, in a posture without symmetry."""
    values = stretch(chain, np.sin(np.arange(1.0, len(chain.masses) + 1.0)))
    return int(np.sum(values > NONE * values[0]))


def shoulder(chain: Chain) -> int:
    """Return the number of the first joint that lifts the hand, in every pose: no yaw joint."""
    return int(np.argmin(np.abs(chain.axes[:, 2]) > UPRIGHT))


def reach(chain: Chain, first: int = 0) -> float:
    """Return the length [m] of the stretched arm, from joint `first` to the end effector."""
    parts = (*chain.offsets[first + 1 :], chain.hand_place, chain.swing_reach)
    return float(sum(np.linalg.norm(part) for part in parts))


def angles_for(
    chain: Chain, position: np.ndarray, low: np.ndarray, high: np.ndarray
) -> tuple[np.ndarray, float]:
    """Return the angles (n,) [rad] within low, high (n,) that bring the hand nearest, and how near.

    position (3,) [m]: in the frame of a level base; the distance [m] is 0 where the arm reaches it.
    """
    from scipy.optimize import least_squares  # the import takes a third of a second

    def miss(angles: np.ndarray) -> np.ndarray:
        return np.array(hand_pose(chain, angles, DOWN)[0]) - position

    best, least = 0.5 * (low + high), np.inf
    slopes = partial(_slopes, chain)
    shares = np.random.default_rng(0).uniform(INSIDE, 1.0 - INSIDE, (STARTS, len(low)))
    for start in low + shares * (high - low):
        found = least_squares(miss, start, slopes, (low, high), xtol=1e-14, ftol=1e-14, gtol=1e-14)
        distance = float(np.linalg.norm(found.fun))
        if distance < least - 1e-9:
            best, least = found.x, distance
    return best, least


def reached(chain: Chain, low: np.ndarray, high: np.ndarray, count: int) -> np.ndarray:
    """Return places (count, 3) [m] of the hand of a level base, angles uniform within low, high."""
    postures = np.random.default_rng(0).uniform(low, high, (count, len(low)))
    return np.array([hand_pose(chain, one, DOWN)[0] for one in postures])


def working_posture(
    chain: Chain,
    stowed: Sequence[float],
    low: np.ndarray,
    high: np.ndarray,
    hinge: tuple[float, float] = (-math.inf, math.inf),
) -> np.ndarray:
    """Return the angles (n,) [rad] within low, high (n,) in which the hand moves best.

    hinge: range [rad] of the hinge that the hand hangs on.

    That is the largest product of the singular values of its Jacobian (Yoshikawa's
    manipulability) and of how level the tool's y axis and its hinge are: upright ones have no
    heading, and let the hand swing by any angle. Found joint by joint from `stowed` on.
    """
    angles = np.clip(np.asarray(stowed, dtype=float), low, high)
    counted = freedom(chain)
    best = _manipulability(chain, angles, counted, hinge)
    improved = True
    while improved:
        improved = False
        for joint in range(len(angles)):
            steps = np.arange(
                math.ceil((low[joint] - angles[joint]) / SEARCH_STEP),
                math.floor((high[joint] - angles[joint]) / SEARCH_STEP) + 1,
            )
            tried = np.repeat(angles[None], len(steps), axis=0)
            tried[:, joint] += SEARCH_STEP * steps
            found = [_manipulability(chain, one, counted, hinge) for one in tried]
            if found and max(found) > best + GAIN * abs(best):
                good = np.flatnonzero(np.array(found) > max(found) - GAIN * abs(max(found)))
                nearest = good[np.argmin(np.abs(steps[good]))]
                best, angles = found[nearest], tried[nearest]
                improved = True
    return angles


def _manipulability(
    chain: Chain, angles: np.ndarray, counted: int, hinge: tuple[float, float]
) -> float:
    """Return the product of the singular values, below 0 where the hinge is beyond its range."""
    stands = float(hinge_angles(chain, angles[None])[0])
    if stands < hinge[0] or stands > hinge[1]:
        return -max(hinge[0] - stands, stands - hinge[1])
    level = math.cos(lean(hand_pose(chain, angles, DOWN)[1]))
    if np.any(chain.swing_axis):
        level *= math.hypot(*turned(last_link(chain, angles)[1], vector(chain.swing_axis))[:2])
    return level * float(np.prod(stretch(chain, angles)[:counted]))
