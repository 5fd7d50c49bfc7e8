"""A joint between magnet and payload that can be closed and opened in flight.

In MuJoCo a joint between free bodies is an equality constraint of the model. This one is a ball
joint at the middle of the payload's plate. While it is closed, magnet and payload do not collide.
"""

from __future__ import annotations

import mujoco
import numpy as np

NAME = "payload_hinge"
REACH = 0.002  # [m] largest gap at which the payload sits on the magnet


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
