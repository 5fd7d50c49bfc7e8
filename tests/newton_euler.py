"""Newton's and Euler's equations of the bodies in a URDF, for a base that floats.

Independent of MuJoCo: the URDF is read with the XML parser, accelerations are central differences
of velocities. Generalized velocities v (6 + n,): of the base's origin [m/s, world], of the base
[rad/s, body], of the joints [rad/s].
"""

from __future__ import annotations

import xml.etree.ElementTree as xml
from dataclasses import dataclass

import numpy as np

from uam_control.maths import rotations

GRAVITY = np.array([0.0, 0.0, 9.81])
STEP = 1e-5  # [s] of the central difference


def _numbers(element, name, default="0 0 0"):
    text = default if element is None else element.get(name, default)
    return np.array([float(word) for word in text.split()])


def _rotation(origin):
    """Return the matrix of roll, pitch, yaw about fixed axes."""
    return rotations.matrix_from_euler(_numbers(origin, "rpy"))


@dataclass(frozen=True)
class Link:
    """A body: mass [kg], centre (3,) [m] and inertia (3, 3) [kg m^2] in its frame; its joint.

    axis (3,): None for a fixed joint; place (3,), turn (3, 3): of the frame in the parent's.
    """

    mass: float
    centre: np.ndarray
    inertia: np.ndarray
    parent: str | None = None
    place: np.ndarray | None = None
    turn: np.ndarray | None = None
    axis: np.ndarray | None = None


def links(urdf: str) -> dict[str, Link]:
    """Return the links by name, each after its parent."""
    robot, found = xml.fromstring(urdf), {}
    joints = {joint.find("child").get("link"): joint for joint in robot.iter("joint")}
    bodies = {link.get("name"): link for link in robot.iter("link")}

    def add(name):
        inertial, joint = bodies[name].find("inertial"), joints.get(name)
        mass, centre, inertia = 0.0, np.zeros(3), np.zeros((3, 3))
        if inertial is not None:
            mass = float(inertial.find("mass").get("value"))
            origin, i = inertial.find("origin"), inertial.find("inertia")
            xx, yy, zz, xy, xz, yz = (
                float(i.get(k)) for k in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
            )
            turn = _rotation(origin)
            inertia = turn @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ turn.T
            centre = _numbers(origin, "xyz")
        if joint is None:
            found[name] = Link(mass, centre, inertia)
        else:
            parent, origin = joint.find("parent").get("link"), joint.find("origin")
            axis = None if joint.get("type") == "fixed" else _numbers(joint.find("axis"), "xyz")
            place, turn = _numbers(origin, "xyz"), _rotation(origin)
            found[name] = Link(mass, centre, inertia, parent, place, turn, axis)
        for child, below in joints.items():
            if below.find("parent").get("link") == name:
                add(child)

    (root,) = set(bodies) - set(joints)
    add(root)
    return found


def velocities(bodies, position, turn, angles, v):
    """Return (rotation, velocity of the centre of mass, angular velocity) of each body, in world.

    position (3,), turn (3, 3): of the base; angles (n,) of the joints.
    """
    frames, found, joint = {}, [], 0
    for name, link in bodies.items():
        if link.parent is None:
            origin, here, speed, spin = position, turn, v[:3], turn @ v[3:6]
        else:
            origin_p, turn_p, speed_p, spin_p = frames[link.parent]
            arm = turn_p @ link.place
            origin, here, spin = origin_p + arm, turn_p @ link.turn, spin_p
            speed = speed_p + np.cross(spin_p, arm)
            if link.axis is not None:
                spin = spin_p + here @ link.axis * v[6 + joint]
                here = here @ rotations.matrix_from_quaternion(
                    rotations.quaternion_from_rotation_vector(angles[joint] * link.axis)
                )
                joint += 1
        frames[name] = origin, here, speed, spin
        found.append((here, speed + np.cross(spin, here @ link.centre), spin))
    return found


def equations(bodies, position, turn, angles, v):
    """Return mass matrix (6 + n, 6 + n) and the forces (6 + n,) that keep v constant."""
    size = len(v)
    units = [velocities(bodies, position, turn, angles, unit) for unit in np.eye(size)]
    now = velocities(bodies, position, turn, angles, v)

    def moved(time):
        ahead = rotations.matrix_from_quaternion(
            rotations.quaternion_from_rotation_vector(time * v[3:6])
        )
        return velocities(bodies, position + time * v[:3], turn @ ahead, angles + time * v[6:], v)

    ahead, behind = moved(STEP), moved(-STEP)
    mass, bias = np.zeros((size, size)), np.zeros(size)
    for k, link in enumerate(bodies.values()):
        here, _, spin = now[k]
        inertia = here @ link.inertia @ here.T
        linear = np.array([unit[k][1] for unit in units])  # (6 + n, 3)
        angular = np.array([unit[k][2] for unit in units])
        mass += link.mass * linear @ linear.T + angular @ inertia @ angular.T
        acceleration = (ahead[k][1] - behind[k][1]) / (2 * STEP)
        turning = (ahead[k][2] - behind[k][2]) / (2 * STEP)
        torque = inertia @ turning + np.cross(spin, inertia @ spin)
        bias += link.mass * linear @ (acceleration + GRAVITY) + angular @ torque
    return mass, bias
