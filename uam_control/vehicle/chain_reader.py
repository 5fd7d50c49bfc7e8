"""The arm of a vehicle, read from its compiled MJCF: any form that MuJoCo reads counts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from uam_control.arm.chain import JOINTS, Chain, with_point
from uam_control.vehicle.description import VehicleDescription
from uam_control.vehicle.loading import VehicleError

if TYPE_CHECKING:
    import mujoco


PREFIX = "gripper_"  # of the names of a gripper's parts
BASE = "base"  # body of the MJCF
HANDS = "end_effector", "magnet_face"  # sites: the first of them, where the YAML names none
OUTSIDE, SWINGS, OF_BASE = -2, -1, 0  # owners of a body; the link of joint i, from 1 on, is i
Lump = tuple[float, np.ndarray, np.ndarray]  # mass [kg], centre (3,) [m], inertia about it (3, 3)


def model_spec(vehicle: VehicleDescription) -> mujoco.MjSpec:
    """Return the MJCF of a vehicle with its gripper. Raises ValueError."""
    import mujoco  # takes 0.3 s and chooses its renderer: only where a model is read

    spec, g = mujoco.MjSpec.from_file(str(vehicle.model)), vehicle.numbers.get("gripper")
    if g is None:
        return spec
    for name in filter(None, (g["body"], g.get("instead_of"))):
        if spec.body(name) is None:
            raise ValueError(f"no body '{name}' for the gripper of {vehicle.file.name}")
    if g.get("instead_of"):
        spec.delete(spec.body(g["instead_of"]))
    part = mujoco.MjSpec.from_file(g["model"])
    part.geom("body").mass = g["mass"]
    for name in ("left", "right"):
        part.geom(name).friction[0] = g["friction"]
    spec.attach(part, frame=spec.body(g["body"]).add_frame(pos=g["position"]), prefix=PREFIX)
    return spec


def chain_of(vehicle: VehicleDescription) -> Chain:
    """Return the arm of a vehicle. Raises VehicleError: one line with the MJCF and the reason."""
    return chain_and_hinge(vehicle)[0]


def chain_and_hinge(vehicle: VehicleDescription) -> tuple[Chain, tuple[float, float]]:
    """Return the arm, and lowest and highest angle [rad] of the hinge that its hand hangs on.

    Infinite for a hand without hinge, or without ends of it. Raises VehicleError, see `chain_of`.
    """
    try:
        reader = ChainReader(model_spec(vehicle).compile(), vehicle.joint_names)
        return reader.chain(vehicle.end_effector), reader.hinge
    except ValueError as error:
        reason = " ".join(str(error).removeprefix("Error: ").split())
        raise VehicleError(f"{vehicle.model}: {reason}") from None


def hand_site(model: mujoco.MjModel, end_effector: str) -> int:
    """Return the number of a site, "" for the first of `HANDS`; -1 if it is not there."""
    import mujoco

    kind = mujoco.mjtObj.mjOBJ_SITE
    names = (end_effector,) if end_effector else HANDS
    found = (mujoco.mj_name2id(model, kind, one) for one in names)
    return next((site for site in found if site >= 0), -1)


class ChainReader:
    """Reads the arm of a compiled model, with every joint at zero, in the base's frame.

    `hinge`: range [rad] of the hinge that the hand hangs on, known with the chain. Raises
    ValueError for joints that are no serial chain of 1 to 7 hinges on the body `base`.
    """

    hinge = -np.inf, np.inf

    def __init__(self, model: mujoco.MjModel, joints: tuple[str, ...]) -> None:
        """joints: their names, base to tip."""
        import mujoco

        numbers = model.jnt_axis, model.jnt_pos, model.body_pos, model.body_quat, model.body_inertia
        if not all(np.isfinite(one).all() for one in numbers):
            raise ValueError("an axis, a place or an inertia is not finite")
        kinds = mujoco.mjtJoint
        self._model, self._hinge = model, int(kinds.mjJNT_HINGE)
        self._base = self._id(mujoco.mjtObj.mjOBJ_BODY, BASE)
        self._joints = [self._id(mujoco.mjtObj.mjOBJ_JOINT, name) for name in joints]
        self._names = ", ".join(joints)
        self._data = data = mujoco.MjData(model)
        turns = np.isin(model.jnt_type, (self._hinge, int(kinds.mjJNT_SLIDE)))
        data.qpos[model.jnt_qposadr[turns]] = 0.0
        mujoco.mj_kinematics(model, data)
        self._turn, self._origin = data.xmat[self._base].reshape(3, 3).T, data.xpos[self._base]
        self._owner = self._owners()

    def chain(self, end_effector: str) -> Chain:
        """Return the chain; end_effector: a site on the last link, "" for one of `HANDS`."""
        model, data, count = self._model, self._data, len(self._joints)
        places = self._inside(data.xanchor[self._joints])
        hand = self._hand(end_effector, places[-1])
        links = [self._lump(self._owner == i + 1) for i in range(count)]
        point = hand["swing_mass"], places[-1] + hand["hand_place"]
        links[-1] = with_point(*links[-1], *point)
        masses, centres, inertias = map(np.array, zip(*links, strict=True))
        dofs = model.jnt_dofadr[self._joints]
        return Chain(
            *(np.diff(places, axis=0, prepend=0.0), data.xaxis[self._joints] @ self._turn.T),
            *(masses, np.where(masses[:, None] > 0.0, centres - places, 0.0), inertias),
            *(model.dof_armature[dofs], model.dof_damping[dofs], model.dof_frictionloss[dofs]),
            *self._lump(self._owner == OF_BASE),
            **hand,
        )

    def _id(self, kind: mujoco.mjtObj, name: str) -> int:
        import mujoco

        found = mujoco.mj_name2id(self._model, kind, name)
        if found < 0:
            raise ValueError(f"no {kind.name.removeprefix('mjOBJ_').lower()} '{name}'")
        return found

    def _owners(self) -> np.ndarray:
        """Return the owner (nbody,) of each body."""
        model, count = self._model, len(self._joints)
        if not 1 <= count <= JOINTS:
            raise ValueError(f"{count} joints; an arm has 1 to {JOINTS}")
        owner = np.full(model.nbody, OUTSIDE)
        for body in range(self._base, model.nbody):
            of = OF_BASE if body == self._base else owner[model.body_parentid[body]]
            for joint in self._joints_of(body):
                if of == OUTSIDE or joint not in self._joints:
                    continue
                text = "is not next" if self._joints.index(joint) != of else "is no hinge"
                if text == "is not next" or model.jnt_type[joint] != self._hinge:
                    raise ValueError(
                        f"joint '{model.joint(joint).name}' {text}: hinges that follow each other "
                        "from the base to the tip are needed"
                    )
                of += 1
            owner[body] = of
        body = model.jnt_bodyid[self._joints[-1]]
        while body > self._base:
            for joint in self._joints_of(body):
                if joint not in self._joints:
                    raise ValueError(
                        f"joint '{model.joint(joint).name}' is not among: {self._names}"
                    )
            body = model.body_parentid[body]
        return owner

    def _joints_of(self, body: int) -> range:
        first = self._model.body_jntadr[body]
        return range(first, first + self._model.body_jntnum[body])

    def _hand(self, end_effector: str, last: np.ndarray) -> dict[str, np.ndarray | float | int]:
        """Return the entries of the end effector in `Chain`; last (3,): the last joint."""
        none = np.zeros(3)
        found = {"has_hand": 0, "hand_place": none, "hand_turn": np.eye(3), "swing_axis": none}
        found |= {"swing_reach": none, "swing_mass": 0.0, "swing_centre": none}
        if (site := hand_site(self._model, end_effector)) < 0:
            if end_effector:
                sites = (self._model.site(i).name for i in range(self._model.nsite))
                there = ", ".join(filter(None, sites))
                raise ValueError(f"no site '{end_effector}'; there are: {there or 'none'}")
            return found
        data = self._data
        place = self._inside(data.site_xpos[site])
        found["hand_turn"] = self._turn @ data.site_xmat[site].reshape(3, 3)
        found |= {"has_hand": 1, "hand_place": place - last}
        if (hinge := self._hinge_of(site)) is not None:
            if self._model.jnt_limited[hinge]:
                self.hinge = tuple(self._model.jnt_range[hinge].tolist())
            pivot = self._inside(data.xanchor[hinge])
            mass, centre, _ = self._lump(self._owner == SWINGS)
            found |= {"hand_place": pivot - last, "swing_axis": self._turn @ data.xaxis[hinge]}
            found |= {"swing_reach": place - pivot, "swing_mass": mass}
            found["swing_centre"] = centre - pivot if mass else place - pivot
        return found

    def _hinge_of(self, site: int) -> int | None:
        """Return the passive hinge that the site hangs on; mark the bodies below it as SWINGS."""
        model, body, found = self._model, self._model.site_bodyid[site], []
        name = model.site(site).name
        if self._owner[body] != len(self._joints):
            raise ValueError(f"site '{name}' is not on the last link")
        upper = model.jnt_bodyid[self._joints[-1]]
        while body != upper:
            found += self._joints_of(body)
            body = model.body_parentid[body]
        if not found:
            return None
        if len(found) > 1 or model.jnt_type[found[0]] != self._hinge:
            raise ValueError(
                f"site '{name}': one hinge at most may be between it and the last link"
            )
        swings = {int(model.jnt_bodyid[found[0]])}
        for body in range(model.nbody):
            if body in swings or model.body_parentid[body] in swings:
                swings.add(body)
        self._owner[list(swings)] = SWINGS
        return found[0]

    def _inside(self, points: np.ndarray) -> np.ndarray:
        """Return world points (..., 3) [m] in the base's frame."""
        return (points - self._origin) @ self._turn.T

    def _lump(self, bodies: np.ndarray) -> Lump:
        """Return the bodies of a mask (nbody,) as one rigid body."""
        masses, centres = self._model.body_mass[bodies], self._inside(self._data.xipos[bodies])
        if not (total := float(masses.sum())):
            return 0.0, np.zeros(3), np.zeros((3, 3))
        centre, inertia = masses @ centres / total, np.zeros((3, 3))
        axes = self._turn @ self._data.ximat[bodies].reshape(-1, 3, 3)
        for mass, at, turn, own in zip(
            masses, centres - centre, axes, self._model.body_inertia[bodies], strict=True
        ):
            inertia += turn @ np.diag(own) @ turn.T + mass * (
                at @ at * np.eye(3) - np.outer(at, at)
            )
        return total, centre, inertia
