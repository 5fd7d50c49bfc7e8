"""The numbers of a serial arm: `Chain` for compiled functions, `ChainParameters` for ROS.

All frames are parallel to the base's (FLU) while every joint is at zero. So a link needs no
rotation of its own; an axis, a centre or an inertia has the numbers that CAD shows in that pose.

A chain is that of a vehicle's compiled MJCF (`chain_of` in vehicle/chain_reader.py), or of a node's
parameters. Vectors and rotations are tuples, see `maths/vectors.py`.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from uam_control.settings.parameter_set import (
    ANY_LENGTH,
    ParameterError,
    ParameterSet,
    number,
    vector,
)

JOINTS = 7  # the most
DIGITS = 12  # of the derived parameters
PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))  # of a symmetric matrix: xx yy zz xy xz yz


class Chain(NamedTuple):
    """An arm of n joints; frames parallel to the base's with every joint at zero.

    Links from their joints; what no joint turns is the base. An end effector may hang on a passive
    hinge in the last link. The mass there is counted in the last link, at the hinge: what swings
    freely carries no moment.
    """

    offsets: np.ndarray  # (n, 3) [m] of a joint from the one before, the first from the origin
    axes: np.ndarray  # (n, 3) unit vectors
    masses: np.ndarray  # (n,) [kg] of the links
    centres: np.ndarray  # (n, 3) [m] of the links, from their joints
    inertias: np.ndarray  # (n, 3, 3) [kg m^2] of the links about their centres
    armature: np.ndarray  # (n,) [kg m^2]
    damping: np.ndarray  # (n,) [N m s/rad]
    friction: np.ndarray  # (n,) [N m]
    base_mass: float
    base_centre: np.ndarray  # (3,)
    base_inertia: np.ndarray  # (3, 3) about its centre
    has_hand: int  # 1: there is an end effector
    hand_place: np.ndarray  # (3,) [m] in the last link
    hand_turn: np.ndarray  # (3, 3) its axes at zero
    swing_axis: np.ndarray  # (3,) of the hinge; zeros: it is fixed
    swing_reach: np.ndarray  # (3,) [m] from the hinge to the end effector
    swing_mass: float  # of what hangs
    swing_centre: np.ndarray  # (3,) of what hangs


def _many(what: str, unit: str, low: float, high: float) -> Any:
    return vector((), what, unit, low, high, ANY_LENGTH, True)


@dataclass(frozen=True)
class ChainParameters(ParameterSet):
    """The arm's numbers, base to tip, in frames parallel to the base's with all joints at zero."""

    joint_offsets: tuple = _many("x y z of each joint, from the one before", "m", -10.0, 10.0)
    joint_axes: tuple = _many("x y z of each joint's axis", "", -1.0, 1.0)
    link_masses: tuple = _many("mass of each link, with what hangs on it", "kg", 0.0, 50.0)
    link_centres: tuple = _many("x y z of each link's mass, from its joint", "m", -10.0, 10.0)
    link_inertias: tuple = _many(
        "xx yy zz xy xz yz of each link about its centre of mass", "kg m^2", -50.0, 50.0
    )
    joint_armature: tuple = _many("reflected inertia of each joint's motor", "kg m^2", 0.0, 10.0)
    joint_damping: tuple = _many("viscous friction of each joint", "N m s/rad", 0.0, 10.0)
    joint_friction: tuple = _many("dry friction of each joint", "N m", 0.0, 10.0)
    base_mass: float = number(0.0, "mass of the vehicle without the links", "kg", 0.0, 100.0)
    base_centre: tuple = _many("x y z of that mass in the base frame", "m", -10.0, 10.0)
    base_inertia: tuple = _many("xx yy zz xy xz yz of that mass", "kg m^2", -50.0, 50.0)
    hand_place: tuple = _many(
        "x y z of the end effector, or of the hinge it hangs on, in the last link", "m", -10.0, 10.0
    )
    hand_turn: tuple = _many("rotation of its axes, row by row", "", -1.0, 1.0)
    swing_axis: tuple = _many(
        "x y z of the hinge that it hangs on; none: it is fixed", "", -1.0, 1.0
    )
    swing_reach: tuple = _many("x y z from that hinge to the end effector", "m", -10.0, 10.0)
    swing_mass: float = number(0.0, "mass that hangs on that hinge", "kg", 0.0, 50.0)
    swing_centre: tuple = _many(
        "x y z from that hinge to the centre of this mass", "m", -10.0, 10.0
    )

    def check_together(self) -> None:
        super().check_together()
        n, per_joint = len(self.link_masses), {
            "joint_offsets": 3, "joint_axes": 3, "link_centres": 3, "link_inertias": 6,
            "joint_armature": 1, "joint_damping": 1, "joint_friction": 1,
        }  # fmt: skip
        whole = {"base_centre": 3, "base_inertia": 6, "hand_place": 3, "hand_turn": 9}
        whole |= dict.fromkeys(("swing_axis", "swing_reach", "swing_centre"), 3)
        if n > JOINTS:
            raise ParameterError(f"link_masses: {n} links; at most {JOINTS} are possible")
        for name, each in per_joint.items():
            if len(getattr(self, name)) != each * n:
                raise ParameterError(
                    f"{name}: {len(getattr(self, name))} numbers, {each * n} expected for {n} "
                    "link_masses"
                )
        for name, count in whole.items():
            if len(getattr(self, name)) not in (0, count):
                raise ParameterError(f"{name}: a list of {count} numbers expected")
        lengths = np.linalg.norm(np.reshape(self.joint_axes, (-1, 3)), axis=1)
        if np.any(np.abs(lengths - 1.0) > 1e-6):
            raise ParameterError("joint_axes: each x y z must have the length 1")

    def chain(self) -> Chain:
        """Return the chain; one of no joints without link_masses."""
        hand, swings = bool(self.hand_place), bool(self.swing_axis)
        turn = np.reshape(self.hand_turn or np.eye(3), (3, 3))
        return Chain(
            *(_points(self.joint_offsets), _points(self.joint_axes), np.array(self.link_masses)),
            *(_points(self.link_centres), _symmetric(self.link_inertias)),
            *(np.array(self.joint_armature), np.array(self.joint_damping)),
            *(np.array(self.joint_friction), float(self.base_mass), _point(self.base_centre)),
            *(_symmetric(self.base_inertia or (0.0,) * 6)[0], int(hand), _point(self.hand_place)),
            *(turn, _point(self.swing_axis)),
            *(_point(self.swing_reach), float(self.swing_mass) * swings),
            _point(self.swing_centre),
        )


# parameter → field of the chain
FIELDS = {
    name: name.removeprefix("joint_").removeprefix("link_") for name in ChainParameters.specs()
}


def as_parameters(chain: Chain) -> dict[str, Any]:
    """Return the values of `ChainParameters` for a chain."""
    values = {name: getattr(chain, of) for name, of in FIELDS.items()}
    values["link_inertias"] = _upper(chain.inertias)
    values["base_inertia"] = _upper(chain.base_inertia[None])
    absent = () if np.any(chain.swing_axis) else ("swing_",)
    absent = absent if chain.has_hand else ("hand_", "swing_")
    given = (name for name in values if not name.startswith(absent))
    return {name: _rounded(values[name]) for name in given}


def carrying(chain: Chain, mass: float) -> Chain:
    """Return the chain with a point mass [kg] at its hand; at the hinge of a hand that hangs."""
    last = chain.masses[-1], chain.centres[-1], chain.inertias[-1]
    masses, centres, inertias = chain.masses.copy(), chain.centres.copy(), chain.inertias.copy()
    masses[-1], centres[-1], inertias[-1] = with_point(*last, mass, chain.hand_place)
    return chain._replace(masses=masses, centres=centres, inertias=inertias)


def with_point(
    own: float, centre: np.ndarray, inertia: np.ndarray, mass: float, place: np.ndarray
) -> tuple[float, np.ndarray, np.ndarray]:
    """Return mass [kg], centre (3,) [m] and inertia about it (3, 3) of a body with a point mass.

    own [kg], centre, inertia: of the body; mass [kg] at place (3,) [m].
    """
    total = own + mass
    if not mass:
        return own, centre, inertia
    apart = place - centre
    more = own * mass / total * (apart @ apart * np.eye(3) - np.outer(apart, apart))
    return total, centre + apart * mass / total, inertia + more


def _rounded(value: np.ndarray | float) -> list[float] | float:
    found = np.round(np.asarray(value, dtype=float), DIGITS) + 0.0
    return found.ravel().tolist() if found.ndim else found.item()


def _points(values: tuple) -> np.ndarray:
    return np.array(values, dtype=float).reshape(-1, 3)


def _point(values: tuple) -> np.ndarray:
    return np.array(values or (0.0, 0.0, 0.0), dtype=float)


def _symmetric(values: tuple) -> np.ndarray:
    """Return matrices (n, 3, 3) of xx yy zz xy xz yz each."""
    upper = np.array(values, dtype=float).reshape(-1, 6)
    found = np.zeros((len(upper), 3, 3))
    for k, (i, j) in enumerate(PAIRS):
        found[:, i, j] = found[:, j, i] = upper[:, k]
    return found


def _upper(matrices: np.ndarray) -> np.ndarray:
    """Return xx yy zz xy xz yz (n, 6) of matrices (n, 3, 3)."""
    return np.stack([matrices[:, i, j] for i, j in PAIRS], axis=1)
