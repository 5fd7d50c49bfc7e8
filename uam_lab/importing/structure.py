"""The parts of a vehicle in a model: base, arm, end effector, rotors. Found, or refused by name."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field

import mujoco
import numpy as np

from uam_lab.importing.rotors import FoundRotor, find_rotors, rotor_joints
from uam_lab.importing.source import ImportRefused, JointFacts, Source
from uam_sim_bridge.plant.arm_geometry import carriers

LONGEST_ARM = 7  # joints
FINGER = re.compile(r"finger|jaw|claw|knuckle|gripper|hand|mimic", re.I)
BASE = "base"  # body of a vehicle of this project
OWN = ("payload", "stand", "drop_mat", "magnet")  # bodies of this project that it adds itself
TAKEN = (BASE, "payload", "magnet_swing")  # joints of every vehicle
TIPS = (r"^magnet$|magnet_face", "tool0|tcp|tool_tip", "end_?effector|eef|ee_link|(^|_)ee($|_)")
TIPS += ("gripper|hand", "tool")
LEVEL = 0.985  # cosine of the largest tilt of a rotor, and of the base in the file
HINGE, SLIDE = mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE
FREE = mujoco.mjtJoint.mjJNT_FREE


@dataclass
class Chosen:
    """Names of parts that the user gives where the file leaves a choice; "" for none."""

    base: str = ""
    arm: str = ""
    end_effector: str = ""
    magnet: bool = True  # whether one is hung at the end effector


@dataclass
class Parts:
    """What was found."""

    source: Source
    model: mujoco.MjModel
    data: mujoco.MjData
    base: int  # its body
    joints: list[int]  # of the arm, base to tip
    owner: np.ndarray  # (bodies,) a body's link: 0 the base, i of joint i - 1, -1 not the vehicle's
    rotors: list[FoundRotor]
    unusable: list[FoundRotor]  # of a file that has too few or too many
    tip: str = ""  # body or site of the end effector, "" for the far end of the last link
    magnet: bool = True
    notes: list[str] = field(default_factory=list)

    def bodies(self, link: int) -> np.ndarray:
        """Return the bodies that move as one with a link, 0: the base."""
        return np.flatnonzero(self.owner == link)

    def frame(self, link: int) -> tuple[np.ndarray, np.ndarray]:
        """Return origin (3,) [m] and axes (3, 3) of a link in the file's world; the origin of a
        link is on its joint."""
        if link == 0:
            return self.data.xpos[self.base], self.data.xmat[self.base].reshape(3, 3)
        joint = self.joints[link - 1]
        body = self.model.jnt_bodyid[joint]
        return self.data.xanchor[joint], self.data.xmat[body].reshape(3, 3)

    def facts(self, joint: int) -> JointFacts:
        """Return what the file says of a joint beside its place."""
        return self.source.joints.get(self.model.joint(joint).name, JointFacts())


def find(source: Source, chosen: Chosen) -> Parts:
    """Return the parts of a description. Raises ImportRefused, by name and line."""
    model = source.compiled()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    base = _base(source, model, chosen.base)
    if (up := float(data.xmat[base][8])) < LEVEL:
        tilt = np.degrees(np.arccos(max(up, -1.0)))
        text = f"its z axis is {tilt:.0f} deg from up; x forward, z up expected"
        raise source.error("body", model.body(base).name, text)
    inside = [b for b in range(base, model.nbody) if base in carriers(model, b)]
    spinning = rotor_joints(model, source, inside)
    joints = _chain(source, model, base, inside, spinning, chosen.arm)
    owner = _owners(model, base, inside, joints)
    found = find_rotors(source, model, data, base, [b for b in inside if owner[b] == 0])
    parts = Parts(source, model, data, base, joints, owner, *found, magnet=chosen.magnet)
    for rotor in parts.rotors:
        if abs(rotor.axis[2]) < LEVEL:
            raise ImportRefused(
                f"{rotor.where}: rotor '{rotor.name}' is tilted by "
                f"{np.degrees(np.arccos(abs(rotor.axis[2]))):.0f} deg; axes parallel to the base's "
                "z are possible"
            )
    parts.tip = _tip(parts, chosen.end_effector)
    return parts


def _base(source: Source, model: mujoco.MjModel, given: str) -> int:
    """Return the body that flies: the only one at the top that may."""
    tops = [b for b in range(1, model.nbody) if model.body_parentid[b] == 0]
    tops = [b for b in tops if model.body(b).name not in OWN]
    names = {model.body(b).name: b for b in tops}
    if given:
        if given not in names:
            raise ImportRefused(f"{source.file}: no body '{given}' at the top; {_listed(names)}")
        return _with_mass(source, model, names[given])
    alone = [b for b in tops if model.body_jntnum[b] == 1]
    free = [b for b in alone if model.jnt_type[model.body_jntadr[b]] == FREE]
    rest = free or [b for b in tops if model.body_subtreemass[b] > 0.0]
    jointed = [b for b in rest if _has_hinge(model, b)]
    rest = jointed if len(rest) > 1 and jointed else rest
    if not rest:
        raise ImportRefused(f"{source.file}: no body with a mass")
    if len(rest) > 1:
        listed = _listed([model.body(b).name for b in rest])
        raise source.error(
            "body", model.body(rest[1]).name, f"several bodies may be the base: {listed}; --base"
        )
    return _with_mass(source, model, rest[0])


def _with_mass(source: Source, model: mujoco.MjModel, base: int) -> int:
    if model.body_subtreemass[base] <= 0.0:
        raise source.error("body", model.body(base).name, "the base has no mass")
    return base


def _has_hinge(model: mujoco.MjModel, top: int) -> bool:
    return any(
        model.jnt_type[j] == HINGE and top in carriers(model, model.jnt_bodyid[j])
        for j in range(model.njnt)
    )


def _chain(
    source: Source,
    model: mujoco.MjModel,
    base: int,
    inside: Sequence[int],
    spinning: set[int],
    first: str,
) -> list[int]:
    """Return the joints of the arm, base to tip; [] without an arm."""
    moving = [
        j
        for j in range(model.njnt)
        if model.jnt_bodyid[j] in inside and model.jnt_bodyid[j] != base and j not in spinning
    ]
    moving = [j for j in moving if not _is_ours(model, model.jnt_bodyid[j])]
    fingers = {j for j in moving if _is_finger(source, model, j, moving)}
    moving = [j for j in moving if j not in fingers]
    above = {j: _joint_above(model, j, moving) for j in moving}
    chain: list[int] = []
    while True:
        here = chain[-1] if chain else -1
        following = [j for j in moving if above[j] == here]
        names = [model.joint(j).name for j in following]
        if first and not chain:
            if first not in names:
                raise ImportRefused(f"{source.file}: no joint '{first}' at the base: {names}")
            following = [following[names.index(first)]]
        ends = [j for j in following if j not in above.values()]
        if chain and len(following) > 1 and ends == following:  # fingers, whatever their name
            break
        if len(following) > 1:
            what = "arms hang on the base" if not chain else "joints follow the same link"
            choice = "; --arm JOINT chooses one" if not chain else "; a serial chain is possible"
            text = f"several {what}: {_listed(names)}{choice}"
            raise source.error("joint", names[1], text)
        if not following:
            break
        chain += following
        _check_joint(source, model, chain)
    return chain


def _is_ours(model: mujoco.MjModel, body: int) -> bool:
    """Return whether a body belongs to the magnet that the import itself adds."""
    return any(model.body(b).name == "magnet" for b in carriers(model, body))


def _is_finger(source: Source, model: mujoco.MjModel, joint: int, moving: Sequence[int]) -> bool:
    """Return whether a joint moves a finger: it follows another one, or ends a branch and says so
    by its name or its body's."""
    name, body = model.joint(joint).name, int(model.jnt_bodyid[joint])
    facts = source.joints.get(name)
    if facts is not None and facts.mimic:
        return True
    named = FINGER.search(name) or FINGER.search(model.body(body).name)
    below = [j for j in moving if j != joint and body in carriers(model, model.jnt_bodyid[j])]
    slides = [j for j in (joint, *below) if model.jnt_type[j] == SLIDE]
    alone = re.search(r"finger|jaw|claw|knuckle|mimic", f"{name} {model.body(body).name}", re.I)
    return bool(named and (len(slides) == 1 + len(below) or alone))


def _joint_above(model: mujoco.MjModel, joint: int, moving: Sequence[int]) -> int:
    """Return the joint of the arm that carries a joint, -1 for the base."""
    body = model.jnt_bodyid[joint]
    same = [j for j in moving if model.jnt_bodyid[j] == body and j < joint]
    if same:
        return same[-1]
    carried = {int(model.jnt_bodyid[j]): j for j in moving}
    above = carriers(model, body)[1:]
    return next((carried[one] for one in above if one in carried), -1)


def _check_joint(source: Source, model: mujoco.MjModel, chain: Sequence[int]) -> None:
    joint = chain[-1]
    name, kind = model.joint(joint).name, model.jnt_type[joint]
    if name in TAKEN or not name:
        raise source.error("joint", name, f"another name is needed: not {', '.join(TAKEN)}")
    if re.fullmatch(r"alpha_\d+", name) and name != f"alpha_{len(chain)}":
        text = f"another name is needed: scenarios call it alpha_{len(chain)}"
        raise source.error("joint", name, text)
    if kind != HINGE:
        said = "prismatic" if kind == SLIDE else "floating" if kind == FREE else "a ball"
        raise source.error("joint", name, f"{said} joint in the arm; revolute ones are possible")
    if len(chain) > LONGEST_ARM:
        raise source.error("joint", name, f"more than {LONGEST_ARM} joints in the arm")
    body = model.jnt_bodyid[joint]
    if model.body_jntnum[body] > 1:
        text = "several joints; one for each body is possible"
        raise source.error("body", model.body(body).name, text)


def _owners(
    model: mujoco.MjModel, base: int, inside: Sequence[int], joints: Sequence[int]
) -> np.ndarray:
    owner = np.full(model.nbody, -1)
    links = {int(model.jnt_bodyid[j]): i + 1 for i, j in enumerate(joints)}
    for body in inside:
        if body == base:
            owner[body] = 0
        elif not _is_ours(model, body):
            owner[body] = links.get(body, owner[model.body_parentid[body]])
    return owner


def _tip(parts: Parts, given: str) -> str:
    """Return the name of the end effector on the last link: a body or site, "" without one."""
    model, last = parts.model, len(parts.joints)
    if not last:
        return ""
    own = set(parts.bodies(last).tolist())
    ours = [model.site(s).name for s in range(model.nsite) if int(model.site_bodyid[s]) in own]
    link = int(model.jnt_bodyid[parts.joints[-1]])
    ours += [model.body(b).name for b in own if b != link]
    ours += [
        model.body(b).name
        for b in range(model.nbody)
        if model.body(b).name == "magnet" and int(model.body_parentid[b]) in own
    ]
    if given:
        if given not in ours:
            raise ImportRefused(
                f"{parts.source.file}: no body or site '{given}' on the last link; {_listed(ours)}"
            )
        return given
    for pattern in TIPS:
        for name in ours:
            if re.search(pattern, name, re.I):
                return name
    return ""


def _listed(names: Sequence[str]) -> str:
    return "there are: " + (", ".join(f"'{name}'" for name in names) or "none")
