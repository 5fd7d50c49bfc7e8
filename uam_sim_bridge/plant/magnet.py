"""The gripper: finite holding force that decreases with the gap, an electromagnet's or any other's.

MuJoCo's adhesion actuator pulls along the normals of the contacts between magnet and payload;
contact and friction decide whether the payload is held. This module sets only the strength.

In MuJoCo a joint between free bodies is an equality constraint of the model. This one is a ball
joint at the middle of the payload's plate. While it is closed, magnet and payload do not collide.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import mujoco
import numpy as np

from uam_control.maths.compiled import borrowing

LAW = 4  # constants of the magnet's law
NO_MAGNET = np.ones(LAW)  # its force is 0: nothing has its control
NAME = "payload_hinge"
REACH = 0.002  # [m] largest gap at which the payload sits on the magnet


def magnet_constants(
    model: mujoco.MjModel, gap_scale: float, curve: Sequence[Sequence[float]] = ()
) -> np.ndarray:
    """Return the constants (4 + 2 k,) of `pull_fraction`: height, reach, thickness, gap_scale, all
    [m], then the curve.

    The first three describe the plate in the payload's frame: height of its upper side, largest
    horizontal distance at which the gripper's face still overlaps it, and thickness. curve: k
    points [gap [m], fraction of the holding force], by gap; without it the magnet's law.
    """
    plate, face = model.geom("payload_plate").size, model.geom("magnet_face").size
    whole = model.geom("payload").size[2], plate[0] + face[0], 2 * plate[2], gap_scale
    return np.array([*whole, *np.ravel(curve)])


@borrowing
def pull_fraction(
    face: np.ndarray, payload: np.ndarray, payload_axes: np.ndarray, constants: np.ndarray
) -> float:
    """Return the fraction 0..1 of the holding force at the present gap to the payload's plate.

    face (3,) [m, world]: centre of the gripper's face; payload (3,) [m, world], payload_axes (9,):
    centre and rotation matrix (payload → world, row by row) of the payload; constants: of
    `magnet_constants`. Reluctance of an air gap: F = F0 / (1 + gap / gap_scale)^2; a curve is
    followed in straight lines, and is constant beyond its ends.
    """
    height, reach, thickness, gap_scale = constants[0], constants[1], constants[2], constants[3]
    gap_squared = 0.0
    for axis in range(3):
        along = 0.0
        for i in range(3):
            along += (face[i] - payload[i]) * payload_axes[3 * i + axis]
        if axis < 2:
            gap = max(abs(along) - reach, 0.0)
        else:
            gap = max(along - height, height - thickness - along, 0.0)
        gap_squared += gap * gap
    gap = math.sqrt(gap_squared)
    if len(constants) > LAW:
        return on_curve(gap, constants)
    ratio = 1.0 + gap / gap_scale
    return 1.0 / (ratio * ratio)


@borrowing
def on_curve(gap: float, constants: np.ndarray) -> float:
    """Return the fraction at a gap [m] on the curve in the constants of `magnet_constants`."""
    last = len(constants) - 2
    for i in range(LAW, last, 2):
        before, after = constants[i], constants[i + 2]
        if gap < after:
            share = max(0.0, (gap - before) / (after - before))
            return constants[i + 1] + share * (constants[i + 3] - constants[i + 1])
    return constants[last + 1]


def add_to(spec: mujoco.MjSpec) -> None:
    """Add the open joint to the model."""
    spec.add_equality(
        name=NAME,
        type=mujoco.mjtEq.mjEQ_CONNECT,
        objtype=mujoco.mjtObj.mjOBJ_BODY,
        name1="payload",
        name2="magnet",
        active=False,
    )


class PayloadHinge:
    """The joint in a model and its data."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """model: with the joint that `add_to` adds."""
        self._model, self._data = model, data
        self._equality = model.equality(NAME).id
        self._magnet, self._payload = model.body("magnet").id, model.body("payload").id
        self._face = model.site("magnet_face").id
        self._geom = model.geom("magnet_face").id
        self._bits = model.geom_contype[self._geom], model.geom_conaffinity[self._geom]
        self._half_height = model.geom("payload").size[2]
        first = model.joint("payload").dofadr[0]
        self._velocity = data.qvel[first : first + 3]  # world
        self._rates = data.qvel[first + 3 : first + 6]  # in the payload's own axes

    @property
    def closed(self) -> bool:
        """Whether the joint is closed: the payload hangs on the magnet."""
        return bool(self._data.eq_active[self._equality])

    def close(self, rate: float) -> bool:
        """Close the joint; return False if the payload is not at the magnet.

        The payload hangs from the present position of the middle of the magnet's face. rate
        [rad/s]: added rotation of the payload about its y axis.
        """
        model, data = self._model, self._data
        face = data.site_xpos[self._face]
        at = self._in_body(self._payload, face)
        if np.linalg.norm(at - (0.0, 0.0, self._half_height)) > 0.03:
            return False
        if at[2] - self._half_height > REACH:
            return False
        model.eq_data[self._equality, 0:3] = at
        model.eq_data[self._equality, 3:6] = self._in_body(self._magnet, face)
        model.geom_contype[self._geom] = model.geom_conaffinity[self._geom] = 0
        data.eq_active[self._equality] = True
        self._rates[1] += rate
        axis = data.xmat[self._payload].reshape(3, 3)[:, 1]
        self._velocity += np.cross(rate * axis, data.xpos[self._payload] - face)
        return True

    def open(self) -> None:
        """Open the joint: the payload is released."""
        self._model.geom_contype[self._geom], self._model.geom_conaffinity[self._geom] = self._bits
        self._data.eq_active[self._equality] = False

    def _in_body(self, body: int, point: np.ndarray) -> np.ndarray:
        """Return a point (3,) [m, world] in the frame of a body (3,) [m]."""
        return self._data.xmat[body].reshape(3, 3).T @ (point - self._data.xpos[body])
