"""Rotors of a description: their places and turns, and what the file says of their thrust."""

import itertools
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from uam_control.vehicle.rotor_geometry import effectiveness
from uam_lab.importing.source import RotorFacts, Source

NAMES = (r"rotor", r"prop(eller)?(?!rio)", r"motor|thrust")
ANY = re.compile("|".join(NAMES), re.I)
HOLDER = re.compile(r"arm|mount|holder|guard|boom|duct", re.I)  # of a rotor, as in arm_motor_0
FEWEST, MOST = 4, 12
ONE_PLACE = 0.03  # [m] across, within which rotors are above each other
TURNS = ((True, re.compile(r"(^|[^a-z])ccw", re.I)), (False, re.compile(r"(^|[^a-z])cw", re.I)))


@dataclass
class FoundRotor:
    """A rotor. position (3,) [m], axis (3,) in the base's frame; radius [m], 0 if unknown."""

    name: str
    where: str
    position: np.ndarray
    axis: np.ndarray
    radius: float
    facts: RotorFacts


def rotor_joints(model: mujoco.MjModel, source: Source, inside: Sequence[int]) -> set[int]:
    """Return the joints about which rotors spin: named so, or their link is."""
    found = set()
    for joint in range(model.njnt):
        body = model.jnt_bodyid[joint]
        names = model.joint(joint).name, model.body(body).name
        hinge = model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_HINGE
        if (
            body in inside
            and hinge
            and (
                any(ANY.search(name) for name in names)
                or any(name in source.rotors for name in names)
            )
        ):
            found.add(joint)
    return found


def find_rotors(
    source: Source,
    model: mujoco.MjModel,
    data: mujoco.MjData,
    base: int,
    bodies: Sequence[int],
) -> tuple[list[FoundRotor], list[FoundRotor]]:
    """Return the rotors on the base, with the direction of each; [] if the file has none that can
    fly; and, in place of them, too few or too many.

    bodies: that are fixed to the base. By the actuators' sites, else by bodies, sites or shapes
    that are named so.
    """
    origin, axes = data.xpos[base], data.xmat[base].reshape(3, 3)

    def rotor(name: str, place: np.ndarray, matrix: np.ndarray, body: int) -> FoundRotor:
        known = (source.rotors[one] for one in (name, *_names(model, body)) if one in source.rotors)
        facts = next(known, None)
        return FoundRotor(
            name=name,
            where=source.where("body", model.body(body).name),
            position=axes.T @ (place - origin),
            axis=axes.T @ matrix.reshape(3, 3)[:, 2],
            radius=_radius(model, data, body) if body != base else 0.0,
            facts=replace(facts) if facts else RotorFacts(),
        )

    sites = {
        s: model.site(s).name for s in range(model.nsite) if int(model.site_bodyid[s]) in bodies
    }
    driven = [s for s, name in sites.items() if name in source.rotors]
    groups = [
        [
            rotor(sites[s], data.site_xpos[s], data.site_xmat[s], model.site_bodyid[s])
            for s in driven
        ]
    ]
    for pattern in NAMES:
        named = [
            b
            for b in bodies
            if b != base and any(re.search(pattern, one, re.I) for one in _names(model, b))
        ]
        bare = [b for b in named if not HOLDER.search(model.body(b).name)]
        named = bare if len(bare) >= FEWEST else named
        found = [
            rotor(model.body(b).name, _centre(model, data, b, origin), _spin(model, data, b), b)
            for b in named
        ]
        groups.append(_apart(found))
        groups.append(
            [
                rotor(name, data.site_xpos[s], data.site_xmat[s], model.site_bodyid[s])
                for s, name in sites.items()
                if re.search(pattern, name, re.I)
            ]
        )
    usable = next((g for g in groups if FEWEST <= len(g) <= MOST), [])
    for one in usable:
        named = next((turn for turn, p in TURNS if p.search(one.name)), None)
        if one.facts.counter_clockwise is None:
            one.facts.counter_clockwise = named
    return usable, [] if usable else max(groups, key=len)


def _names(model: mujoco.MjModel, body: int) -> list[str]:
    first, count = model.body_jntadr[body], model.body_jntnum[body]
    return [model.body(body).name, *(model.joint(first + i).name for i in range(count))]


def _centre(
    model: mujoco.MjModel, data: mujoco.MjData, body: int, origin: np.ndarray
) -> np.ndarray:
    """Return where a rotor's body is [m]: at its joint or frame; in the middle of its first shape
    where the frame is at the origin (3,) [m] of the base."""
    if model.body_jntnum[body]:
        return data.xanchor[model.body_jntadr[body]]
    own = np.flatnonzero(model.geom_bodyid == body)
    if len(own) and np.linalg.norm(data.xpos[body] - origin) < ONE_PLACE:
        return data.geom_xpos[own[0]]
    return data.xpos[body]


def _spin(model: mujoco.MjModel, data: mujoco.MjData, body: int) -> np.ndarray:
    """Return axes (9,) whose third is the rotor's."""
    if not model.body_jntnum[body]:
        return data.xmat[body]
    matrix = np.zeros((3, 3))
    matrix[:, 2] = data.xaxis[model.body_jntadr[body]]
    return matrix.ravel()


def _radius(model: mujoco.MjModel, data: mujoco.MjData, body: int) -> float:
    """Return the largest half width [m] of the shapes of a rotor's body."""
    own = np.flatnonzero(model.geom_bodyid == body)
    return max((float(np.sort(model.geom_aabb[g, 3:])[-1]) for g in own), default=0.0)


def _apart(rotors: list[FoundRotor]) -> list[FoundRotor]:
    """Return the rotors that are at different places: motor and propeller are one."""
    kept: list[FoundRotor] = []
    for one in rotors:
        if all(np.linalg.norm(one.position - other.position) > ONE_PLACE for other in kept):
            kept.append(one)
    return kept


def turns(rotors: Sequence[FoundRotor]) -> tuple[list[bool], str]:
    """Return for each rotor whether it turns counter-clockwise, and why, if not by the file.

    Else, and where roll and yaw would be one, neighbours turn in opposite directions, and rotors
    above each other too.
    """
    stated = [one.facts.counter_clockwise for one in rotors]
    places = np.array([one.position for one in rotors])
    why = "neighbours turn in opposite directions"
    if all(turn is not None for turn in stated):
        moments = np.where(np.array(stated, dtype=bool), 1.0, -1.0)
        if np.linalg.matrix_rank(effectiveness(places[:, 0], -places[:, 1], moments)) == 4:
            return [bool(turn) for turn in stated], ""
        why += ", with those of the file yaw and roll, pitch or thrust would be one"
    angles = np.arctan2(places[:, 1], places[:, 0])
    order = sorted(range(len(rotors)), key=lambda i: (round(angles[i], 2), -places[i, 2]))
    found, column, last = [False] * len(rotors), -1, None
    for i in order:
        above = last is not None and np.linalg.norm(places[i, :2] - places[last, :2]) < ONE_PLACE
        column += 0 if above else 1
        found[i] = (column % 2 == 0) != bool(above)
        last = i
    return found, why


def neighbours(positions: np.ndarray) -> float:
    """Return the smallest distance [m] across between rotors that are not above each other."""
    pairs = itertools.combinations(positions[:, :2], 2)
    return min(d for d in (float(np.linalg.norm(a - b)) for a, b in pairs) if d > ONE_PLACE)
