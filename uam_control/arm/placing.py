"""Base and arm for a place of the end effector: the base level, the arm near a posture.

The base does the place and the heading, so the arm keeps its posture. It leaves it, by the least
change, where the base would leave its room, for elevation and lean of the tool, and for the hinge
of a hand that hangs.
"""

from typing import NamedTuple

import numpy as np

from uam_control.arm.chain import Chain
from uam_control.arm.hand import (
    ELEVATION,
    HEADING,
    LEAN,
    STEP,
    hinge_angles,
    jacobians,
    least_change,
    tools,
)
from uam_control.coordinates import ALPHA, ARM, POSITION, YAW
from uam_control.maths.rotations import wrap_angle

BEYOND, TURNED, HINGE = slice(0, 3), slice(3, 5), 5  # columns of what is off: [m], [rad]
TILTS = [ELEVATION, LEAN]  # of TOOL
CLOSE = 1e-8  # [m, rad] at which the search ends
ROUNDS = 30
LONGEST = 0.5  # [rad] of one step of a joint
STARTS = 6  # further postures, from which one is sought


class Room(NamedTuple):
    """base (2, 3) [m], joints (2, n) [rad], hinge (2,) [rad] of the hand: lowest, highest."""

    base: np.ndarray
    joints: np.ndarray
    hinge: np.ndarray


class Placed(NamedTuple):
    """Level bases with their arms. Off: the base from its room (BEYOND), elevation and lean of the
    tool from those wanted (TURNED), the hand's hinge from its range (HINGE)."""

    chi: np.ndarray  # (m, 6 + n)
    off: np.ndarray  # (m, 6); zeros where all is met


def placed(chain: Chain, wanted: np.ndarray, posture: np.ndarray, room: Room) -> Placed:
    """Return base and arm for tools at `wanted` (m, 6), columns TOOL; NaN: any elevation, lean.

    posture (n,) [rad]. One that is not met from the posture on is sought from others, for a single
    tool.
    """
    count = len(posture)
    found = _approached(chain, wanted, np.tile(posture, (len(wanted), 1)), room)
    if len(wanted) > 1 or not np.any(np.abs(found.off) > CLOSE) or not count:
        return found
    shares = np.random.default_rng(0).uniform(size=(STARTS, count))
    low, high = room.joints
    others = _approached(
        chain, np.repeat(wanted, STARTS, axis=0), low + shares * (high - low), room
    )
    off = np.linalg.norm(others.off, axis=1)
    away = np.linalg.norm(others.chi[:, ARM] - posture, axis=1)
    best = np.lexsort((away, np.where(off > CLOSE, off, 0.0)))[0]
    better = off[best] < np.linalg.norm(found.off) - CLOSE
    return Placed(others.chi[[best]], others.off[[best]]) if better else found


def turning(chain: Chain, chi: np.ndarray, rates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the rates (6 + n,) of base and arm that move the tool, and what of it is not met.

    chi (6 + n,), counted as level; rates (6,): of TOOL. Elevation and lean are the arm's, all else
    is the base's. Not met (2,) [rad/s]: of elevation and lean.
    """
    level = chi.copy()
    level[POSITION], level[YAW - 2 : YAW] = 0.0, 0.0
    slopes = jacobians(chain, level[None], range(ALPHA, len(chi)))[0]
    found = np.zeros_like(chi)
    if slopes.shape[1] and np.any(rates[TILTS]):
        found[ARM] = least_change(slopes[None, TILTS], rates[None, TILTS])[0]
    swung = slopes @ found[ARM]
    found[YAW] = rates[HEADING] - swung[HEADING]
    x, y, _ = tools(chain, level[None])[0, POSITION]
    found[POSITION] = rates[POSITION] - swung[POSITION]
    found[POSITION] -= found[YAW] * np.array([-y, x, 0.0])
    return found, rates[TILTS] - swung[TILTS]


def _approached(chain: Chain, wanted: np.ndarray, starts: np.ndarray, room: Room) -> Placed:
    """Return what is found from arms at `starts` (m, n) [rad] on, by least changes."""
    low, high = room.joints
    angles, (rows, joints) = np.clip(starts, low, high), starts.shape
    steps = STEP * np.vstack([np.zeros(joints), np.eye(joints)])
    for _ in range(ROUNDS):
        moved = (angles[:, None] + steps).reshape(-1, joints)
        chi = _based(chain, np.repeat(wanted, joints + 1, axis=0), moved)
        off = _off(chain, np.repeat(wanted, joints + 1, axis=0), chi, room)
        off = off.reshape(rows, joints + 1, -1)
        if np.abs(off[:, 0]).max() <= CLOSE:
            break
        slopes = ((off[:, 1:] - off[:, :1]) / STEP).swapaxes(1, 2)
        step = least_change(slopes, -off[:, 0])
        ends = ((step < 0.0) & (angles <= low)) | ((step > 0.0) & (angles >= high))
        step = least_change(np.where(ends[:, None], 0.0, slopes), -off[:, 0])
        longest = np.abs(step).max(axis=1, initial=LONGEST, keepdims=True)
        angles = np.clip(angles + step * LONGEST / longest, low, high)
    chi = _based(chain, wanted, angles)
    return Placed(chi, _off(chain, wanted, chi, room))


def _based(chain: Chain, wanted: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Return chi (m, 6 + n) of arms at angles (m, n) [rad] whose hands have place and heading."""
    chi = np.zeros((len(angles), ALPHA + angles.shape[1]))
    chi[:, ARM] = angles
    chi[:, YAW] = wanted[:, HEADING] - tools(chain, chi)[:, HEADING]
    chi[:, POSITION] = wanted[:, POSITION] - tools(chain, chi)[:, POSITION]
    return chi


def _off(chain: Chain, wanted: np.ndarray, chi: np.ndarray, room: Room) -> np.ndarray:
    """Return what is off (m, 6), see `Placed`."""
    off = np.zeros((len(chi), HINGE + 1))
    off[:, BEYOND] = chi[:, POSITION] - np.clip(chi[:, POSITION], *room.base)
    hinge = hinge_angles(chain, np.ascontiguousarray(chi[:, ARM]))
    off[:, HINGE] = hinge - np.clip(hinge, *room.hinge)
    off[:, TURNED] = np.nan_to_num(wrap_angle(tools(chain, chi)[:, TILTS] - wanted[:, TILTS]))
    return off
