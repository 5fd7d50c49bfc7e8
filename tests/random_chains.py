"""Random serial arms on a floating base, and the same in Pinocchio."""

import numpy as np
import pytest

from uam_control.arm.chain import Chain
from uam_control.maths.rotations import euler_from_quaternion, matrix_from_euler

pin = pytest.importorskip("pinocchio")  # of the extra "test"
NO_HAND = {
    "has_hand": 0, "hand_place": np.zeros(3), "hand_turn": np.eye(3), "swing_axis": np.zeros(3),
    "swing_reach": np.zeros(3), "swing_mass": 0.0, "swing_centre": np.zeros(3),
}  # fmt: skip


def inertia(random):
    """Of a body with three random principal masses."""
    points = random.normal(size=(3, 3)) * 0.05
    return sum(p @ p * np.eye(3) - np.outer(p, p) for p in points)


def random_chain(random):
    n = int(random.integers(1, 8))
    axes = random.normal(size=(n, 3))
    turn = pin.Quaternion(*unit(random.normal(size=4))).matrix()
    hand = {"has_hand": 1, "hand_place": random.normal(size=3) * 0.1, "hand_turn": turn}
    return Chain(
        random.normal(size=(n, 3)) * 0.2,
        axes / np.linalg.norm(axes, axis=1)[:, None],
        random.uniform(0.02, 0.4, n),
        random.normal(size=(n, 3)) * 0.1,
        np.array([inertia(random) for _ in range(n)]),
        *random.uniform(0.0, 0.02, (3, n)),
        2.0,
        random.normal(size=3) * 0.03,
        inertia(random),
        **(NO_HAND | hand),
    )


def unit(vector):
    return vector / np.linalg.norm(vector)


def in_pinocchio(chain):
    """The chain on a free-flying base."""
    model = pin.Model()
    parent = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "base")
    own = pin.Inertia(chain.base_mass, chain.base_centre, chain.base_inertia)
    model.appendBodyToJoint(parent, own, pin.SE3.Identity())
    for i, axis in enumerate(chain.axes):
        kind = pin.JointModelRevoluteUnaligned(*axis)
        at = pin.SE3(np.eye(3), chain.offsets[i])
        parent = model.addJoint(parent, kind, at, f"joint_{i}")
        body = pin.Inertia(chain.masses[i], chain.centres[i], chain.inertias[i])
        model.appendBodyToJoint(parent, body, pin.SE3.Identity())
    hand = pin.Frame(
        "hand", parent, 0, pin.SE3(chain.hand_turn, chain.hand_place), pin.FrameType.OP_FRAME
    )
    model.addFrame(hand)
    return model


def chi_of(model, q, v, a):
    """chi, chi_dot, chi_ddot of Pinocchio's q, v, a: velocities of the base in its own frame."""
    x, y, z, w = q[3:7]
    euler = euler_from_quaternion(np.array([w, x, y, z]))
    turn = matrix_from_euler(euler)
    linear = turn @ (a[:3] + np.cross(v[3:6], v[:3]))
    return np.array(
        [
            [*q[:3], *euler, *q[7:]],
            [*turn @ v[:3], *v[3:]],
            [*linear, *a[3:]],
        ]
    )


def random_motion(random, model):
    q = pin.integrate(model, pin.neutral(model), random.normal(size=model.nv) * 0.4)
    return q, random.normal(size=model.nv), random.normal(size=model.nv)
