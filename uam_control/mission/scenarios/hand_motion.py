"""The motion of base and arm that moves an end effector along its task.

The base is where the hand needs it: p = r - R f(alpha), with R from differential flatness, so from
the acceleration of p itself. Near level, for a hand at the height f_z below the base, this is
p + (f_z / g) p_ddot = r - f on the horizontal axes: an elliptic equation, whose bounded solution
begins before the task does. Solved along the whole trajectory by Newton's method; the splines of
its iterates have all derivatives that a motion needs.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from uam_control.arm.hand import ELEVATION, HEADING, hands, jacobians, least_change
from uam_control.coordinates import ALPHA, ARM, CHI, CHI_DDOT, PITCH, POSITION, ROLL, YAW
from uam_control.maths.rotations import wrap_angle
from uam_control.mission.motion.flatness import Flyer, flattened
from uam_control.mission.motion.polynomials import Polynomials
from uam_control.mission.scenarios.fitted_spline import CurveSamples, fitted

KNOTS = (0.2, 0.1, 0.05)  # [s] between two knots of the splines: the coarsest that suffices
SAMPLES = 5  # between two knots
BEFORE = 2.0  # [s] in which the base begins before the hand, and ends after it
MEETS, MEETS_ANGLE = 1e-4, 1e-3  # [m], [rad] of the hand, from its task
CLOSE = 2e-5  # [m, rad] at which the iteration ends
# of the iteration; after the first ones it goes on while each is better by this factor
ROUNDS, FIRST, BETTER = 40, 4, 0.9


class Unreachable(ValueError):
    """No motion has the hand on its task; the text says by how much it is off, and when."""


class Task(NamedTuple):
    """A task of the hand over time."""

    path: Polynomials  # hand: POSITION [m], YAW (heading), PITCH (elevation) [rad]; ARM: posture
    elevated: bool  # whether the elevation is kept
    headed: bool  # whether the heading is kept
    moves: tuple[int, ...]  # numbers of the joints that may leave the posture for them


class Sampled(NamedTuple):
    """Poses with the attitude of a flat base."""

    times: np.ndarray  # (m,) [s]
    chi: np.ndarray  # (m, 6 + n)
    force: np.ndarray  # (m, 3) [m/s^2] of the rotors, per mass


def following(task: Task, flyer: Flyer) -> Polynomials:
    """Return the motion of base and arm (6 + n coordinates) whose hand is on the task.

    It begins BEFORE the task and ends as long after it, at rest. Raises Unreachable.
    """

    def corrected(chi: np.ndarray, _: np.ndarray, flown: Sampled, off: np.ndarray) -> None:
        chi[:, POSITION] += _shifted(off[:, POSITION], flown, flyer)
        chi[:, YAW] += off[:, HEADING]
        if task.elevated:
            chi[:, ARM] += _raised(flown.chi, off[:, ELEVATION], task, flyer)

    return _solved(task, flyer, None, corrected)


def holding(task: Task, base: Polynomials, flyer: Flyer) -> Polynomials:
    """Return the motion whose hand is on the task while the base follows `base`.

    base: columns POSITION, of the times of the task. Yaw and joints do the task, as near to the
    posture as they can be. Raises Unreachable.
    """
    columns = [YAW, *range(ALPHA, base.coefficients.shape[2])]
    kept = [*range(3), *[HEADING] * task.headed, *[ELEVATION] * task.elevated]

    def corrected(chi: np.ndarray, begun: np.ndarray, flown: Sampled, off: np.ndarray) -> None:
        slopes, posture = jacobians(flyer.chain, flown.chi, columns)[:, kept], begun[:, columns]
        left = np.einsum("ijk,ik->ij", slopes, chi[:, columns] - posture)
        chi[:, columns] = posture + least_change(slopes, off[:, kept] + left)

    return _solved(task, flyer, base, corrected)


def _solved(
    task: Task,
    flyer: Flyer,
    base: Polynomials | None,
    corrected: Callable[[np.ndarray, np.ndarray, Sampled, np.ndarray], None],
) -> Polynomials:
    """Return the motion whose hand is on the task, from the task's posture on.

    base: where the base is, None: above the hand; corrected(chi, begun, flown, off): corrects chi
    (m, 6 + n), which was begun with that of the posture, for a hand that is off by (m, 5).
    """
    for step in KNOTS:
        times = _grid(task.path, step / SAMPLES)
        wanted = _wanted(task, times)
        chi = begun = _begun(wanted, flyer)
        if base is None:
            chi[:, POSITION] -= hands(flyer.chain, level_at_origin(chi))[:, POSITION]
        else:
            chi[:, POSITION] = _wanted(Task(base, False, False, ()), times)[:, POSITION]
        least = math.inf
        for done in range(ROUNDS):
            (motion,) = fitted(times, [CurveSamples(chi)], math.inf, step)
            flown = flat(motion, times, flyer)
            off = _off(flown.chi, wanted, task, flyer)
            least, before = np.abs(off).max(), least
            if least < CLOSE or (done >= FIRST and not least <= BETTER * before):
                break
            chi = motion.rows(times, 1)[CHI]
            corrected(chi, begun, flown, off)
        misses = _missed(motion, task, flyer)
        if not misses:
            return motion
    raise Unreachable(misses)


def flat(motion: Polynomials, times: np.ndarray, flyer: Flyer) -> Sampled:
    """Return the poses of a motion with the attitude that its acceleration needs."""
    rows = motion.rows(times, CHI_DDOT + 1)
    return Sampled(times, rows[CHI], flattened(rows, flyer))


def _grid(path: Polynomials, step: float) -> np.ndarray:
    first, last = path.knots[0] - BEFORE, path.knots[-1] + BEFORE
    return np.linspace(first, last, math.ceil((last - first) / step) + 1)


def _wanted(task: Task, times: np.ndarray) -> np.ndarray:
    """Return the task (m, 6 + n) at times (m,) [s], at rest before it and after it."""
    return task.path.rows(times, 1)[CHI].copy()


def _begun(wanted: np.ndarray, flyer: Flyer) -> np.ndarray:
    """Return chi (m, 6 + n) of level bases whose hand, in the posture, has the heading `wanted`."""
    chi = wanted.copy()
    chi[:, PITCH] = 0.0  # the task's elevation
    level = level_at_origin(chi)
    level[:, YAW] = 0.0
    chi[:, YAW] -= np.unwrap(hands(flyer.chain, level)[:, HEADING])
    return chi


def level_at_origin(chi: np.ndarray) -> np.ndarray:
    """Return chi (m, 6 + n) of level bases at the origin, with their yaw and arm."""
    found = chi.copy()
    found[:, POSITION], found[:, ROLL:YAW] = 0.0, 0.0
    return found


def _off(chi: np.ndarray, wanted: np.ndarray, task: Task, flyer: Flyer) -> np.ndarray:
    """Return the task minus the hand of chi, (m, 5), zero where it is not kept."""
    goal = np.concatenate([wanted[:, POSITION], wanted[:, [YAW, PITCH]]], axis=1)
    off = goal - hands(flyer.chain, chi)
    off[:, HEADING:] = wrap_angle(off[:, HEADING:])
    off[:, HEADING] *= task.headed
    off[:, ELEVATION] *= task.elevated
    return off


def _shifted(off: np.ndarray, flown: Sampled, flyer: Flyer) -> np.ndarray:
    """Return the correction of the base (m, 3) [m] for a hand that is off by (m, 3) [m].

    A change of the acceleration turns the base by n x dn, with n = F / |F|, and moves the hand, at
    w from the base, by A = ((n w) I - n w^T) (I - n n^T) / |F| times as much. So the correction c
    solves c + A c'' = off; where the hand is above the base, so that waves solve it, without A.
    """
    from scipy.sparse import bsr_matrix, diags, identity, kron
    from scipy.sparse.linalg import spsolve

    count, step = len(off), flown.times[1] - flown.times[0]
    away = hands(flyer.chain, flown.chi)[:, POSITION] - flown.chi[:, POSITION]
    size = np.linalg.norm(flown.force, axis=1)[:, None, None]
    along = flown.force[:, :, None] / size
    upward = np.einsum("ij,ij->i", along[:, :, 0], away)[:, None, None]
    across = np.eye(3) - along @ along.swapaxes(1, 2)
    turned = (upward * np.eye(3) - along @ away[:, None]) @ across / size
    turned[[0, -1]] = 0.0
    turned *= upward.mean() < 0.0
    second = kron(diags([1.0, -2.0, 1.0], [-1, 0, 1], shape=(count, count)), identity(3))
    blocks = bsr_matrix((turned / step**2, np.arange(count), np.arange(count + 1)))
    return spsolve((identity(3 * count) + blocks @ second).tocsc(), off.ravel()).reshape(-1, 3)


def _raised(chi: np.ndarray, off: np.ndarray, task: Task, flyer: Flyer) -> np.ndarray:
    """Return the correction of the joints (m, n) [rad] for an elevation that is off by (m,)."""
    columns = [ALPHA + joint for joint in task.moves]
    slopes = jacobians(flyer.chain, chi, columns)[:, [ELEVATION]]
    found = np.zeros_like(chi[:, ARM])
    found[:, list(task.moves)] = least_change(slopes, off[:, None])
    return found


def _missed(motion: Polynomials, task: Task, flyer: Flyer) -> str:
    """Return by how much the hand of a motion is off its task, and when; "" if it meets it."""
    times = _grid(task.path, KNOTS[-1] / SAMPLES)
    off = np.abs(_off(flat(motion, times, flyer).chi, _wanted(task, times), task, flyer))
    far = off / [*[MEETS] * 3, MEETS_ANGLE, MEETS_ANGLE]
    worst, column = np.unravel_index(np.argmax(far), far.shape)
    if far[worst, column] <= 1.0:
        return ""
    by = 1e3 * np.linalg.norm(off[worst, POSITION]), np.degrees(off[worst, column])
    amount = f"{by[0]:.3g} mm" if column < HEADING else f"{by[1]:.3g} deg"
    return f"the hand is {amount} off its task at {times[worst] - times[0]:.1f} s"
